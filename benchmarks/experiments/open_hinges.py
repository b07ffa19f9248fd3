"""How well cameras tell the hinge and the opening of doors that stand open, before anything moves.

    python benchmarks/experiments/open_hinges.py [--tasks close_microwave ...] [--seeds 0 1 ...]

One line a start: distance of the true hinge from the estimated one [mm], by how much the opening is off [deg]; then
medians. Furniture for testing.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from manipose_mj.console.process import one_thread_per_process

one_thread_per_process()

import numpy as np  # noqa: E402

from manipose_mj import suite  # noqa: E402
from manipose_mj.control.baseline import Baseline  # noqa: E402
from manipose_mj.control.perception.pose_sources import sensors_for  # noqa: E402
from manipose_mj.failures import StageFailure  # noqa: E402
from manipose_mj.poses import transform  # noqa: E402
from manipose_mj.tasks.core.config import EnvConfig  # noqa: E402

_TASKS = ("close_cabinet_door", "close_microwave", "close_oven")
_GOOD = (15.0, 3.0)  # a start whose hinge and opening are no further off [mm, deg]


@dataclass(frozen=True)
class Row:
    """Attributes: task, seed; furniture, its name; place [mm]; opening [deg]: errors, infinite where it was not found."""

    task: str
    seed: int
    furniture: str
    place: float
    opening: float


def measured(task: str, seed: int) -> Row:
    """One start."""
    config = EnvConfig(
        f"articulated/{task}", obs_mode="state", split="test", sensors=sensors_for("estimated")
    )
    environment = suite.make(config, seed)
    environment.reset()
    played, physics = environment.task, environment.physics
    name, part = played.furniture.asset.name, played.part.name
    joint = physics.bind(played.furniture.joint(part))
    anchor, true = np.array(joint.xanchor), float(np.asarray(joint.qpos).item())
    perception = Baseline(environment, "estimated").perception
    try:
        perception.reset(seed)
        found = perception.observe().parts[part]
    except StageFailure:
        return Row(task, seed, name, np.inf, np.inf)
    if found.joint.kind != "hinge":
        return Row(task, seed, name, np.inf, np.inf)
    origin = transform(found.base_pose, found.joint.origin[None])[0]
    axis = found.base_pose[:3, :3] @ found.joint.axis
    place = float(np.linalg.norm(np.cross(anchor - origin, axis)))
    return Row(task, seed, name, 1000 * place, float(np.degrees(abs(found.opening - true))))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tasks", nargs="+", default=_TASKS)
    parser.add_argument("--seeds", nargs="+", type=int, default=list(range(10)))
    options = parser.parse_args()
    rows = []
    for task in options.tasks:
        for seed in options.seeds:
            row = measured(task, seed)
            rows.append(row)
            print(
                f"{task:<20}{seed:>4}  {row.furniture:<16}{row.place:7.1f} mm {row.opening:6.1f} deg",
                flush=True,
            )
    for task in options.tasks:
        own = [row for row in rows if row.task == task]
        good = sum(row.place <= _GOOD[0] and row.opening <= _GOOD[1] for row in own)
        place, opening = (np.median([getattr(row, k) for row in own]) for k in ("place", "opening"))
        print(
            f"{task}: median {place:.1f} mm, {opening:.1f} deg; within {_GOOD[0]:.0f} mm and {_GOOD[1]:.0f} deg: "
            f"{good} of {len(own)}"
        )


if __name__ == "__main__":
    main()
