"""How far off the baseline's estimates of objects are at the starts of tasks.

    python benchmarks/experiments/object_estimates.py "clutter/*" [--episodes 4] [--resample 7] [--networks several]

Starts are those of protocol v1, with other seeds if `--resample` says so. Every object that perception sees counts, goal or
not. `--networks one` estimates each camera's cloud by itself and lets the shapes of known objects choose among the
hypotheses; `several` fuses the clouds first. Right is within 15 deg and 2 cm, flipped beyond 90 deg. Seconds are those of
making a start and looking at it for the first time. Furniture is the simulator's.
"""

from __future__ import annotations

import argparse
import logging
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch

import numpy as np

from manipose_mj.control.perception.estimated import EstimatedPerception
from manipose_mj.control.perception.kind_estimators import shipped_estimator
from manipose_mj.control.perception.objects.object_kinds import ObjectKind
from manipose_mj.control.perception.pose_sensing import Estimator
from manipose_mj.control.perception.pose_sources import sensors_for
from manipose_mj.evaluation.config import episode_seed
from manipose_mj.evaluation.episode import environment_of
from manipose_mj.evaluation.protocol.frozen import Protocol, load
from manipose_mj.failures import StageFailure
from manipose_mj.poses import pose_error
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.environment import TaskEnvironment

RIGHT = (0.02, np.deg2rad(15.0))


@dataclass(frozen=True)
class Estimated:
    """Attributes: task; object_type; shift [m] and turn [rad] from the truth; confidence."""

    task: str
    object_type: str
    shift: float
    turn: float
    confidence: float

    @property
    def right(self) -> bool:
        """As confidence means it."""
        return self.shift < RIGHT[0] and self.turn < RIGHT[1]


def of_single_views(kind: ObjectKind) -> Estimator:
    """The networks of the category, or of the type, that look through one camera."""
    from manipose_mj.ppf_jax.estimator import PoseEstimator  # loads JAX

    return PoseEstimator.load(kind.category if kind.in_catalogue else kind.object_type)


def started(protocol: Protocol, task: str, number: int, resample: int | None) -> TaskEnvironment:
    """An environment at a start of the protocol, or at one of another seed, with the cameras of estimates."""
    asked = dict(protocol.episode(task, number).asked)
    if resample is not None:
        asked["seed"] = episode_seed(resample, f"{protocol.version}/{task}", number)
    config = EnvConfig(task, obs_mode="state", split="test", sensors=sensors_for("estimated"))
    environment = environment_of(config)
    environment.reset(EpisodeSpec(**asked))
    return environment


def estimates(
    protocol: Protocol, task: str, number: int, resample: int | None, networks: str
) -> Iterator[Estimated]:
    """Of every object that is seen at a start."""
    environment = started(protocol, task, number, resample)
    chosen = of_single_views if networks == "one" else shipped_estimator
    perception = EstimatedPerception(environment.task, environment.physics, estimators=chosen)
    perception.reset(0)
    perception.observe()
    for found in perception.last_estimates:
        entity = environment.task.objects[found.name]
        label = entity.asset.label
        truth = entity.object_pose(environment.physics) @ label.pose
        shift, turn = pose_error(found.pose, truth, label.symmetry)
        yield Estimated(task, label.object_type, float(shift), float(turn), found.confidence)


def line(name: str, rows: Sequence[Estimated]) -> str:
    """One row of the table."""
    sure = [row for row in rows if row.confidence > 0.9]
    right = np.mean([row.right for row in rows])
    flipped = np.mean([row.turn > np.pi / 2 for row in rows])
    turn = np.rad2deg(np.median([row.turn for row in rows]))
    shift = 100 * np.median([row.shift for row in rows])
    of_sure = f"{sum(row.right for row in sure)} of {len(sure)}"
    return (
        f"{name:28} {len(rows):5} {right:7.1%} {flipped:8.1%} {turn:6.1f} {shift:6.2f}  {of_sure}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("tasks", nargs="+", help="such as clutter/pick or 'clutter/*'")
    parser.add_argument("--episodes", type=int, default=4)
    parser.add_argument("--first", type=int, default=0, help="number of the first start")
    parser.add_argument("--resample", type=int, default=None, metavar="SEED")
    parser.add_argument("--networks", default="several", choices=("one", "several"))
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    protocol = load("v1")
    by_name: dict[str, list[Estimated]] = defaultdict(list)
    seconds = []
    tasks = [task for task in protocol.tasks if any(fnmatch(task, one) for one in options.tasks)]
    for task in tasks:
        for number in range(options.first, options.first + options.episodes):
            began = time.perf_counter()
            try:
                rows = list(estimates(protocol, task, number, options.resample, options.networks))
            except StageFailure as failure:
                print(f"{task} {number}: {failure}", flush=True)
                continue
            seconds.append(time.perf_counter() - began)
            for row in rows:
                for name in ("all", task, row.object_type):
                    by_name[name].append(row)
    print(
        f"{'':28} {'n':>5} {'right':>7} {'flipped':>8} {'deg':>6} {'cm':>6}  confidence > 0.9: right"
    )
    for name, rows in by_name.items():
        print(line(name, rows))
    print(f"{np.median(seconds):.1f} s a start")


if __name__ == "__main__":
    main()
