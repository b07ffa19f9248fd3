"""Do the articulated objects of a source behave? Each is built, pulled open, and given a ball to hold.

    python benchmarks/experiments/articulated_audit.py ../shared/data/partnet_mobility.tar.xz [--out DIR] [--only 7167 ...]

One row an object: its joints, how many of them stay shut for 2 s and then reach 95 % of their range
under 20 N or 5 N m; how many cavities take a ball of 6 cm through the open drawer or door and keep it;
how many of the links that have a handle carry its label; mass, collision shapes and build time.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from asset_pipeline.build.data_set import SOURCES, build
from asset_pipeline.build.pool import BuildResult
from asset_pipeline.checks.asset_check import check_asset
from asset_pipeline.checks.cavity_check import takes_ball
from asset_pipeline.sources.scan import ScanItem
from manipose_mj.assets.asset_json import read_asset

HEAD = ("object", "category", "size [cm]", "joints", "move", "cavities", "ball in", "handles",
        "labelled", "kg", "shapes", "build s")  # fmt: skip
WIDTHS = (8, 13, 14, 7, 5, 9, 8, 8, 9, 6, 7, 8)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Build, open and fill articulated objects.")
    parser.add_argument("path", type=Path)
    parser.add_argument("--source", default="partnet_mobility")
    parser.add_argument(
        "--out", type=Path, help="keep the assets here; up to date ones are not built"
    )
    parser.add_argument("--only", nargs="+", default=[])
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        out = arguments.out or Path(scratch)
        results = build(
            arguments.source, arguments.path, out, only=arguments.only, jobs=arguments.jobs
        )
        items = {item.name: item for item in SOURCES[arguments.source].items(arguments.path)}
        print(_row(HEAD))
        failures = [f for r in results for f in audit(r, items[r.name], arguments.source)]
    print(f"\n{len(results)} objects, {len(failures)} failures")
    for failure in failures:
        print(f"  {failure}")


def audit(result: BuildResult, item: ScanItem, source: str) -> list[str]:
    """Print an object's row; returns what went wrong with it."""
    if result.status == "failed":
        print(f"{result.name:>8}  {result.reason}")
        return [f"{result.name}: {result.reason}"]
    asset = read_asset(result.folder)
    checked = check_asset(result.folder)
    stuck = {p.name for p in asset.parts if any(repr(p.name) in f for f in checked.failures)}
    hollow = [p for p in asset.parts if p.cavity is not None]
    spilled = [line for p in hollow if (line := takes_ball(asset, p))]
    with SOURCES[source].opened(item) as scan:
        requested = {m.name for m in scan.moving if any(p.name == "handle" for p in m.parts)}
    labelled = {p.name for p in asset.parts if p.handle is not None}
    size = " x ".join(f"{100 * e:.0f}" for e in asset.label.extents)
    print(
        _row((
            result.name, asset.category, size, len(asset.parts), len(asset.parts) - len(stuck),
            len(hollow), len(hollow) - len(spilled), len(requested), len(requested & labelled),
            f"{asset.mass_properties.mass:.1f}", checked.parts, f"{result.seconds:.1f}",
        )),
        flush=True,
    )  # fmt: skip
    missing = [f"part {name!r} has a handle but no label" for name in sorted(requested - labelled)]
    return [f"{result.name}: {line}" for line in (*checked.failures, *spilled, *missing)]


def _row(values: tuple[object, ...]) -> str:
    return "  ".join(f"{value!s:>{width}}" for value, width in zip(values, WIDTHS, strict=True))


if __name__ == "__main__":
    main()
