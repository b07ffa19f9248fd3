"""The baseline's targets for frozen starts, kept to compare two evaluations; nothing may be trained on them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from manipose_mj.demos.attempts import TapedBaseline
from manipose_mj.demos.playback import slowed
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.episode import Naming, environment_of, play
from manipose_mj.evaluation.rollout import Rules

# Of so many episodes one stops half-way: a comparison of successes alone would show little.
CUT_EVERY = 5


def record_targets(task: str, protocol: str, episodes: int, hz: int) -> dict[int, np.ndarray]:
    """Run the baseline in the first frozen episodes.

    Args:
      task: `"domain/name"`.
      protocol: Version.
      episodes: How many.
      hz: Rate at which the targets shall be played.

    Returns:
      Targets `(t, 8)` in float32, as LeRobot hands them over, by seed and in the order of the episodes.
    """
    config = EvaluationConfig((task,), Path(), episodes, protocol=protocol)
    environment = environment_of(config.env_config(task))
    found = {}
    for number in range(episodes):
        tape = TapedBaseline()
        naming = Naming(task, number, tape.pose_source, tape.mask_source)
        spec = config.episode_spec(task, number)
        result, _ = play(environment, tape, spec, Rules(), naming)
        targets = slowed(np.array(tape.taken)[: result.steps], hz).astype(np.float32)
        cut = (number + 1) % CUT_EVERY == 0
        found[result.seed] = targets[: len(targets) // 2] if cut else targets
    return found


def write_targets(path: Path, targets: Mapping[int, np.ndarray]) -> None:
    """Write them for `FrozenTargets`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **{str(seed): each for seed, each in targets.items()})


class FrozenTargets:
    """A policy that answers with one target after the other, and then with the last."""

    def __init__(self, path: str) -> None:
        """Reads what `write_targets` wrote."""
        with np.load(path) as file:
            self._targets = {int(seed): file[seed] for seed in file}
        self._left = np.zeros((0, 8), np.float32)

    def reset(self, *, seed: int, **episode: Any) -> None:
        """Take up the targets of the episode's seed."""
        self._left = self._targets[seed]

    def infer(self, obs: Mapping[str, Any]) -> dict[str, Any]:
        """The next target."""
        chosen, rest = self._left[:1], self._left[1:]
        self._left = rest if len(rest) else chosen
        return {"actions": chosen}
