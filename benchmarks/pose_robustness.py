"""How errors grow with the share of points that are outliers, and of the object that is hidden.

    python benchmarks/pose_robustness.py --picture robustness.png [--json FILE] [--categories bowl ...]
        [--weights pose] [--views 4] [--setting anywhere] [--jobs 1]

Test objects of the catalogue; bare points, so that normals are estimated from the corrupted cloud. Outliers
fill a ball of one and a half times the object's radius; what hides is a straight edge at any angle. The same
views at every share. Networks are the package's, or `DIR/CATEGORY/weights.npz` with `--weights DIR`. Views that
keep fewer points than an estimator accepts are left out and counted. Exits with 1 if an answer is not finite.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import jax
import numpy as np
from pose_tables.options import (
    check_categories,
    check_files,
    network_of,
    one_camera_setting,
    write_rows,
)
from rich.console import Console
from rich.table import Table

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.data.augmentation.corruption import partly_hidden, with_outliers
from manipose_mj.ppf_jax.data.view_cache import catalogue_clouds
from manipose_mj.ppf_jax.estimator import MIN_POINTS, PoseEstimator
from manipose_mj.ppf_jax.evaluation.pose_metrics import pose_errors, summary
from manipose_mj.ppf_jax.points.clouds import LabelledCloud

CATEGORIES = ("bowl", "box", "cup", "hammer", "mug", "razor")
Corruption = Callable[[np.ndarray, float, np.random.Generator], np.ndarray]
KINDS: dict[str, tuple[Corruption, tuple[float, ...]]] = {
    "outliers": (with_outliers, (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "hidden": (partly_hidden, (0.0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8)),
}
_BATCH = 40


@dataclass(frozen=True)
class Row:
    """One category at one share.

    Attributes: category; kind of corruption; share; n views, left_out for too few points; finite,
    whether every answer was; means and medians [deg, cm].
    """

    category: str
    kind: str
    share: float
    n: int
    left_out: int
    finite: bool
    deg_mean: float
    deg_median: float
    origin_cm_mean: float
    origin_cm_median: float


def row_of(
    category: str,
    kind: str,
    share: float,
    estimator: PoseEstimator,
    clouds: Sequence[LabelledCloud],
) -> Row:
    """Corrupt the clouds, estimate, compare."""
    corrupt, _ = KINDS[kind]
    corrupted = [
        corrupt(cloud.points, share, np.random.default_rng([i, len(kind)]))
        for i, cloud in enumerate(clouds)
    ]
    rows = [i for i, points in enumerate(corrupted) if len(points) >= MIN_POINTS]
    found = []
    for start in range(0, len(rows), _BATCH):
        some = [corrupted[i] for i in rows[start : start + _BATCH]]
        # Filled up, so that all batches have one shape.
        filled = some + [corrupted[rows[0]]] * (_BATCH - len(some))
        key = jax.random.fold_in(jax.random.key(0), start)
        found += estimator.estimate_many(filled, key=key)[: len(some)]
    finite = all(
        np.isfinite(each.pose).all()
        and np.isfinite(each.extents).all()
        and 0 <= each.confidence <= 1
        for each in found
    )
    figures = dict.fromkeys(
        ("deg_mean", "deg_median", "origin_cm_mean", "origin_cm_median"), np.nan
    )
    if finite and found:
        poses = np.stack([each.pose for each in found])
        known = summary(pose_errors(poses, [clouds[i] for i in rows]))
        figures = {name: float(known[name]) for name in figures}
    return Row(category, kind, share, len(rows), len(clouds) - len(rows), finite, **figures)


def draw(path: Path, rows: Sequence[Row]) -> None:
    """Median errors over the shares, a line for each category."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    panels = figure.subplots(2, 2, sharex="col")
    for column, kind in enumerate(KINDS):
        for line, (name, unit) in enumerate(
            (("deg_median", "orientation [deg]"), ("origin_cm_median", "origin [cm]"))
        ):
            axes = panels[line, column]
            for category in dict.fromkeys(row.category for row in rows):
                own = [row for row in rows if (row.category, row.kind) == (category, kind)]
                shares = [100 * row.share for row in own]
                axes.plot(shares, [getattr(row, name) for row in own], ".-", label=category)
            axes.set_yscale("log")
            axes.grid(alpha=0.3)
            axes.set_ylabel(f"median error, {unit}")
            if line:
                axes.set_xlabel(f"{kind} [%]")
    panels[0, 0].legend(fontsize="small")
    figure.savefig(path, dpi=120)


def table_of(rows: Sequence[Row]) -> Table:
    """Medians, means in brackets."""
    table = Table("category", "", title="deg / cm: medians (means)")
    shares = sorted({row.share for row in rows})
    for share in shares:
        table.add_column(f"{share:.0%}", justify="right")
    for category, kind in dict.fromkeys((row.category, row.kind) for row in rows):
        own = {row.share: row for row in rows if (row.category, row.kind) == (category, kind)}
        table.add_row(category, kind, *(_cell(own.get(share)) for share in shares))
    return table


def _cell(row: Row | None) -> str:
    if row is None:
        return ""
    text = f"{row.deg_median:.1f} ({row.deg_mean:.1f})\n"
    return text + f"{row.origin_cm_median:.2f} ({row.origin_cm_mean:.2f})"


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, draw; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--categories", nargs="+", default=list(CATEGORIES), metavar="NAME")
    parser.add_argument("--weights", type=Path, metavar="DIR")
    parser.add_argument("--setting", default="anywhere")
    parser.add_argument("--views", type=int, default=4, help="of each of the test objects")
    parser.add_argument("--jobs", type=int, default=1, help="processes that render")
    parser.add_argument("--picture", type=Path, metavar="FILE")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args(argv)
    rows: list[Row] = []
    try:
        setting = one_camera_setting(options.setting)
        check_categories(options.categories)
        check_files(options.json, options.picture)
        estimators = {name: network_of(name, options.weights) for name in options.categories}
        for category, estimator in estimators.items():
            clouds = catalogue_clouds(
                category, "test", setting, views=options.views, jobs=options.jobs
            )
            for kind, (_, shares) in KINDS.items():
                rows += [row_of(category, kind, share, estimator, clouds) for share in shares]
        Console(width=None if sys.stdout.isatty() else 150).print(table_of(rows))
        if options.json is not None:
            write_rows(options.json, [asdict(row) for row in rows])
    except InputError as error:
        print(f"pose_robustness: {error}", file=sys.stderr)
        return 2
    if options.picture is not None:
        draw(options.picture, rows)
    broken = [f"{row.category}, {row.share:.0%} {row.kind}" for row in rows if not row.finite]
    print(f"not finite: {'; '.join(broken)}" if broken else "every answer is finite")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
