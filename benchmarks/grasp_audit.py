"""The published grasp audit: of each category, how many objects a Panda's hand can take and hold.

    python benchmarks/grasp_audit.py FOLDER_OF_ASSETS [--again] [--markdown FILE] [--record FILE]

Every asset carries the outcome of its trials: `asset_pipeline.build.grasp_trial` closed a floating hand on up to
60 of its collision-free grasps, lifted and shook it, by friction alone, until 20 had held. `--again`
repeats the trials here with a finer time step, a longer lift and a wider shake.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed

from asset_pipeline.build.grasp_trial import TrialConfig, with_trials
from manipose_mj.assets.asset import MIN_HELD
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.assets.categories import CATALOGUE

FINE = TrialConfig(
    timestep=0.002, close_time=0.5, lift=0.15, lift_time=0.4, shake=0.03, frequency=3.0
)
HEADER = ("category", "instances", "graspable", "median held", "median tried")


@dataclass(frozen=True)
class Audited:
    """One rigid object. Attributes: name, category; held and tried, numbers of grasps."""

    name: str
    category: str
    held: int
    tried: int

    @property
    def graspable(self) -> bool:
        """Whether enough of its grasps held."""
        return self.held >= MIN_HELD


def audited(folder: Path, again: bool) -> Audited | None:
    """The outcome of an asset's trials; None for what is not rigid.

    Args:
      folder: Of the asset.
      again: Whether to repeat them; those whose outcome the asset lacks are repeated anyway.
    """
    asset = read_asset(folder)
    if asset.kind != "rigid" or asset.grasps is None:
        return None
    grasps = asset.grasps
    if again or grasps.tried is None:
        config = FINE if again else None
        grasps = with_trials(grasps, asset.stable_poses, asset.model_path, config=config)
    return Audited(asset.name, asset.category, grasps.held, grasps.tried or 0)


def table(rows: Sequence[Audited]) -> list[tuple[str, ...]]:
    """The lines of the table, one for each category and one for all."""
    groups: dict[str, list[Audited]] = defaultdict(list)
    for row in rows:
        groups[row.category].append(row)
    return [_line(name, groups[name]) for name in sorted(groups)] + [_line("all", rows)]


def record(rows: Iterable[Audited]) -> dict[str, dict[str, list[int]]]:
    """How many grasps of each built-in object held, by category and index, as `inventory` reads it."""
    held = {row.name: row.held for row in rows}
    return {
        "held": {
            name: [held[category.instance(i)] for i in range(category.instances)]
            for name, category in CATALOGUE.items()
            if all(category.instance(i) in held for i in range(category.instances))
        }
    }


def machine() -> str:
    """The versions and the machine that the numbers are of."""
    packages = ", ".join(f"{p} {version(p)}" for p in ("mujoco", "numpy", "scipy", "trimesh"))
    cores = f"{os.cpu_count()} x {platform.processor() or platform.machine()}"
    return f"{packages}, Python {platform.python_version()}; {cores}, {platform.system()}"


def _line(name: str, rows: Sequence[Audited]) -> tuple[str, ...]:
    held, tried = np.median([r.held for r in rows]), np.median([r.tried for r in rows])
    share = np.mean([r.graspable for r in rows])
    return name, str(len(rows)), f"{share:.0%}", f"{held:g}", f"{tried:g}"


def _markdown(lines: Sequence[tuple[str, ...]], notes: Sequence[str]) -> str:
    rows = [HEADER, ("---", *["---:"] * (len(HEADER) - 1)), *lines]
    return "\n".join(["| " + " | ".join(row) + " |" for row in rows] + ["", *notes]) + "\n"


def main() -> None:
    """Print the table and, where asked, write it down."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("assets", type=Path, help="folder of asset folders")
    parser.add_argument("--again", action="store_true", help="repeat the trials, more finely")
    parser.add_argument("--jobs", type=int, default=1, help="worker processes for --again")
    parser.add_argument("--markdown", type=Path, help="write the table into this file")
    parser.add_argument("--record", type=Path, help="write the numbers of the catalogue as JSON")
    arguments = parser.parse_args()
    start = time.perf_counter()
    calls = (delayed(audited)(folder, arguments.again) for folder in list_assets(arguments.assets))
    rows = [row for row in Parallel(n_jobs=arguments.jobs)(calls) if row is not None]
    if not rows:
        parser.error(f"{arguments.assets} holds no rigid asset")
    lines = table(rows)
    for row in (HEADER, *lines):
        print(f"{row[0]:<18}" + "".join(f"{cell:>14}" for cell in row[1:]))
    notes = [
        f"Graspable: at least {MIN_HELD} grasps held; tried until so many held or 60 were tried.",
        f"{machine()}; {time.perf_counter() - start:.0f} s.",
    ]
    print("", *notes, sep="\n")
    for row in rows:
        if not row.graspable:
            print(f"not graspable: {row.name} ({row.held} of {row.tried} held)")
    if arguments.markdown:
        arguments.markdown.write_text(_markdown(lines, notes), encoding="utf-8")
    if arguments.record:
        arguments.record.write_text(json.dumps(record(rows)) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
