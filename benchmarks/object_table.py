"""Rigid objects through tasks of the baseline, with true or with estimated poses, object by object.

    manipose assets build ycb PATH --out SCANS/ycb
    python benchmarks/object_table.py --assets SCANS/ycb [SCANS/gso ...] [--tasks single_object/target_pose ...]
        [--pose estimated] [--only NAME ...] [--skip NAME ...] [--every N] [--seeds 0 1] [--jobs 2] [--json FILE]
    python benchmarks/object_table.py --drawn --tasks "articulated/take_out_*" [--seeds 0 1]

Without a folder: one test object of each rigid category of the catalogue, `--each` another one (0: the first); with
`--drawn` what each seed draws of all test objects and furniture. Names of tasks may hold `*` and `?`. One line an
episode; then of each task how many succeeded of those that it takes, and why it takes the others not.
Objects of whose grasps too few survived the trials of the build are in brackets; they do not count. With estimated
poses a failure names its stage: `perception` where the pose that was acted on was beyond the tolerance of success.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from manipose_mj.console.process import one_thread_per_process

one_thread_per_process()

import numpy as np  # noqa: E402
from joblib import Parallel, delayed  # noqa: E402

from manipose_mj.assets import catalogue  # noqa: E402
from manipose_mj.assets.asset import Asset  # noqa: E402
from manipose_mj.assets.asset_json import list_assets, read_asset  # noqa: E402
from manipose_mj.assets.categories import CATALOGUE  # noqa: E402
from manipose_mj.control.perception.pose_sources import POSE_SOURCES, sensors_for  # noqa: E402
from manipose_mj.errors import InputError  # noqa: E402
from manipose_mj.evaluation.episode import run_episode  # noqa: E402
from manipose_mj.evaluation.statistics import wilson_interval  # noqa: E402
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec  # noqa: E402
from manipose_mj.tasks.core.registry import tasks_named  # noqa: E402

TASKS = ("single_object/target_pose", "articulated/store_middle_drawer")
_SPLIT = "test"
_SHORT = 60  # of a refusal's reason, in the summary


@dataclass(frozen=True)
class Row:
    """One episode, or a refusal.

    Attributes: task; object; graspable: by the build's trials; seed, None where the task does not take the object;
      succeeded; reason: why not; seconds; category; pose: where poses came from; error_cm, error_deg: of the estimate
      that was acted on, None with true poses or where nothing was grasped.
    """

    task: str
    object: str
    graspable: bool
    seed: int | None
    succeeded: bool
    reason: str
    seconds: float
    category: str = ""
    pose: str = "oracle"
    error_cm: float | None = None
    error_deg: float | None = None


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--assets", nargs="+", type=Path, default=[], help="folders of asset folders"
    )
    parser.add_argument("--each", type=int, default=0, help="which test object of a category")
    parser.add_argument("--drawn", action="store_true", help="objects that the seeds draw")
    parser.add_argument("--every", type=int, default=1, help="take every so many of the objects")
    parser.add_argument("--pose", choices=POSE_SOURCES, default="oracle")
    parser.add_argument("--tasks", nargs="+", default=list(TASKS), help="names or patterns")
    parser.add_argument("--only", nargs="+", default=[], help="names of assets")
    parser.add_argument("--skip", nargs="+", default=[], help="names of assets to leave out")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--jobs", type=int, default=1, help="episodes at the same time")
    parser.add_argument("--json", type=Path, help="where to write the rows")
    options = parser.parse_args()
    tasks, chosen = tasks_named(options.tasks), _chosen(options)
    calls = (
        delayed(played)(task, asset, [seed], options.pose)
        for task in tasks
        for asset in chosen
        for seed in options.seeds
    )
    rows: list[Row] = []
    for some in Parallel(n_jobs=options.jobs, return_as="generator")(calls):
        for row in some:
            if row in rows:  # the task takes the object with no seed
                continue
            rows.append(row)
            print(line_of(row), flush=True)
    for task in tasks:
        print(summary_of([row for row in rows if row.task == task]))
    if options.json is not None:
        options.json.write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n")


def played(task: str, asset: Asset | None, seeds: Sequence[int], pose: str) -> list[Row]:
    """An episode of each seed; one row with the reason where the task does not take the object.

    Args:
      task: `"domain/name"`.
      asset: That it is about; None: what each seed draws.
      seeds: Of the episodes.
      pose: Where poses come from.
    """
    objects = None if asset is None else (str(asset.folder),)
    config = EnvConfig(
        task, obs_mode="state", split=_SPLIT, objects=objects, sensors=sensors_for(pose)
    )
    graspable, rows = asset is None or asset.graspable is not False, []
    category = "" if asset is None else asset.category
    for seed in seeds:
        started = time.perf_counter()
        try:
            result, _ = run_episode(config, EpisodeSpec(seed), pose=pose)
        except InputError as error:
            name = "" if asset is None else asset.name
            return [Row(task, name, graspable, None, False, str(error), 0.0, category, pose)]
        done, took = result.success_at_end, time.perf_counter() - started
        reason = "" if done else f"{result.failure}: {result.reason}"
        shift, turn = result.estimate_translation_error, result.estimate_rotation_error
        cm = None if shift is None else 100 * shift
        deg = None if turn is None else float(np.degrees(turn))
        name = result.object if asset is None else asset.name
        rows.append(Row(task, name, graspable, seed, done, reason, took, category, pose, cm, deg))
    return rows


def line_of(row: Row) -> str:
    """A row as people read it."""
    what = "refused" if row.seed is None else f"{row.seed:>4} {'yes' if row.succeeded else 'NO':<3}"
    name = row.object if row.graspable else f"({row.object})"
    errors = ""
    if row.error_cm is not None and row.error_deg is not None:
        errors = f"{row.error_cm:4.1f} cm {row.error_deg:4.0f} deg  "
    return f"{row.task:<32} {name:<36.36} {what} {row.seconds:5.0f} s  {errors}{row.reason}"


def summary_of(rows: Sequence[Row]) -> str:
    """How many episodes of a task succeeded, and how many objects it refused for which reason."""
    episodes = [row for row in rows if row.seed is not None and row.graspable]
    done, count = sum(row.succeeded for row in episodes), len(episodes)
    refused = Counter(_cause(row.reason) for row in rows if row.seed is None)
    text = f"{rows[0].task if rows else '-'}: {done} of {count}"
    if count:
        low, high = wilson_interval(done, count)
        text += f" ({done / count:.0%}, 95 % interval {low:.0%} to {high:.0%})"
    return "; ".join([text, *(f"{n} refused: {cause}" for cause, n in refused.most_common())])


def _cause(reason: str) -> str:
    """A refusal without the object's folder and figures."""
    words = reason.split(": ", 1)[-1]
    return "".join("#" if letter.isdigit() else letter for letter in words)[:_SHORT]


def _chosen(options: argparse.Namespace) -> Sequence[Asset | None]:
    if options.drawn:
        return [None]
    assets = _scans(options.assets) if options.assets else _of_catalogue(options.each)
    named = [
        asset
        for asset in assets
        if (not options.only or asset.name in options.only) and asset.name not in options.skip
    ]
    return named[:: options.every]


def _scans(folders: Sequence[Path]) -> list[Asset]:
    found = [read_asset(path) for folder in folders for path in list_assets(folder)]
    return [asset for asset in found if asset.kind == "rigid"]


def _of_catalogue(which: int) -> list[Asset]:
    """Of each category of rigid objects one that is held out."""
    chosen = []
    for category, row in CATALOGUE.items():
        asset = None
        held_out = [index for index in range(row.instances) if row.split(index) == _SPLIT]
        if held_out:
            asset = catalogue.load(category, held_out[which % len(held_out)])
        if asset is not None and asset.kind == "rigid":
            chosen.append(asset)
    return chosen


if __name__ == "__main__":
    main()
