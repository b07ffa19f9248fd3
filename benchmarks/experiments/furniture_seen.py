"""How well cameras tell where furniture, its handles and hinges are, before anything moves.

    manipose assets build partnet_mobility PATH --out DIR
    python -m benchmarks.experiments.furniture_seen --assets DIR [--verbs close] [--seeds 0 1 ...] [--jobs 2]

One line a start of each handled part: by how much the frame of the furniture is turned [deg], how far the handle of
the part that is asked for is from the true one and its hinge from the true hinge [mm]; then how many are good, and how
many are right in everything, within the bars of the estimator's own tables: parts, and pieces most of whose parts are.
"""

from __future__ import annotations

import argparse
import multiprocessing
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from manipose_mj.console.process import one_thread_per_process

one_thread_per_process()

import numpy as np  # noqa: E402

from benchmarks.furniture_table import Case, assets_in, config_for, handled_parts  # noqa: E402
from manipose_mj.control.baseline import Baseline  # noqa: E402
from manipose_mj.control.perception.pose_sources import sensors_for  # noqa: E402
from manipose_mj.control.scene.scene_estimate import PartEstimate  # noqa: E402
from manipose_mj.evaluation.episode import environment_of  # noqa: E402
from manipose_mj.failures import StageFailure  # noqa: E402
from manipose_mj.poses import pose_error, transform  # noqa: E402
from manipose_mj.ppf_jax.evaluation.part_metrics import (  # noqa: E402
    ANGLE_BAR,
    CENTRE_BAR,
    LINE_BAR,
)
from manipose_mj.tasks.core.config import EpisodeSpec  # noqa: E402

_GOOD = (1.0, 15.0, 25.0)  # a start whose frame, handle and hinge are no further off [deg, mm, mm]


@dataclass(frozen=True)
class Row:
    """Attributes: frame [deg]; handle, hinge [mm]: errors, infinite where it was not found or taken for another kind;
    turns: of handle and joint [rad]."""

    frame: float = np.inf
    handle: float = np.inf
    hinge: float = np.inf
    turns: tuple[float, float] = (np.inf, np.inf)

    @property
    def all_right(self) -> bool:
        """Whether handle and joint are within the bars of the estimator's tables."""
        near = self.handle <= 1000 * CENTRE_BAR and self.hinge <= 1000 * LINE_BAR
        return near and max(self.turns) <= ANGLE_BAR


def measured(case: Case) -> Row:
    """What is seen at the start with the first seed."""
    asset = case.load()
    part, seed = asset.part(case.part), case.seeds[0]
    config = replace(config_for(asset, part, case.verb), sensors=sensors_for("estimated"))
    environment = environment_of(config)
    environment.reset(EpisodeSpec(seed, furniture=asset.name, part=part.name))
    seen = {}
    for pose in ("oracle", "estimated"):
        perception = Baseline(environment, pose).perception
        try:
            perception.reset(seed)
        except StageFailure:
            return Row()
        seen[pose] = perception.observe().parts[part.name]
    return _compared(seen["oracle"], seen["estimated"])


def _compared(true: PartEstimate, found: PartEstimate) -> Row:
    # Built furniture may have its front along another axis: quarter turns say nothing.
    turns = [np.arctan2(*each.base_pose[[1, 0], 0]) for each in (true, found)]
    frame = abs((np.degrees(turns[1] - turns[0]) + 45) % 90 - 45)
    assert true.handle is not None
    assert found.handle is not None
    handle = 1000 * float(np.linalg.norm(true.handle_pose[:3, 3] - found.handle_pose[:3, 3]))
    if true.joint.kind != found.joint.kind:
        return Row(frame, handle)
    hinge, axes = 0.0, [each.base_pose[:3, :3] @ each.joint.axis for each in (true, found)]
    if true.joint.kind == "hinge":
        places = [transform(each.base_pose, each.joint.origin[None])[0] for each in (true, found)]
        hinge = 1000 * float(np.linalg.norm(np.cross(places[0] - places[1], axes[1])))
    _, turned = pose_error(found.handle_pose, true.handle_pose, true.handle.symmetry)
    direction = float(np.arccos(np.clip(axes[0] @ axes[1], -1.0, 1.0)))
    return Row(frame, handle, hinge, (float(turned), direction))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--assets", type=Path, help="folder of asset folders")
    parser.add_argument("--verbs", nargs="+", default=["open", "close"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    for verb in options.verbs:
        cases = [
            Case(folder, asset.name, part.name, verb, (seed,), "estimated")
            for folder, asset in assets_in(options.assets)
            for part in handled_parts(asset)
            for seed in options.seeds
        ]
        rows = []
        with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
            for case, row in zip(cases, pool.imap(measured, cases), strict=True):
                rows.append(row)
                print(
                    f"{verb:<6}{case.asset:<16}{case.part:<10}{case.seeds[0]:>4}  "
                    f"{row.frame:6.1f} deg {row.handle:7.0f} mm {row.hinge:7.0f} mm "
                    f"{'right' if row.all_right else ''}",
                    flush=True,
                )
        _print_shares(verb, cases, rows)


def _print_shares(verb: str, cases: Sequence[Case], rows: Sequence[Row]) -> None:
    """How many are good, how many right."""
    for name, least in zip(("frame", "handle", "hinge"), _GOOD, strict=True):
        values = np.array([getattr(row, name) for row in rows])
        print(
            f"{verb}, {name}: median {np.median(values):.1f}; within {least:.0f}: "
            f"{(values <= least).sum()} of {len(values)}"
        )
    pieces = defaultdict(list)
    for case, row in zip(cases, rows, strict=True):
        pieces[case.asset].append(row.all_right)
    mostly = sum(np.mean(each) > 0.5 for each in pieces.values())
    print(
        f"{verb}, right in everything: {sum(row.all_right for row in rows)} of {len(rows)} parts, "
        f"{mostly} of {len(pieces)} pieces"
    )


if __name__ == "__main__":
    main()
