"""Recordings as a policy: `--policy manipose_mj.demos.playback:RecordedPolicy --policy-args '{"data": "DIR"}'`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from manipose_mj.demos.layout import RECORDED_HZ, DemoEpisode, DemoSet, find_sets, read_actions
from manipose_mj.errors import InputError, brief
from manipose_mj.policies.protocol import ActionSpace

ABSOLUTE = (
    "pd_joint_pos",
    "pd_ee_pose",
)  # control modes of which a later action replaces an earlier one


class RecordedPolicy:
    """Answers with the recorded actions of the episode's seed, all at once."""

    def __init__(self, data: str) -> None:
        """Reads the descriptions of the recordings in a folder, or of one file.

        Raises:
          InputError: There are none, one is broken, or two hold an episode in the same control mode.
        """
        self._data = data
        self._episodes: dict[tuple[str, int], dict[str, tuple[DemoSet, DemoEpisode]]] = {}
        for demos in find_sets(Path(data)):
            for episode in demos.episodes:
                modes = self._episodes.setdefault((demos.task, episode.episode_seed), {})
                if episode.control_mode in modes:
                    raise InputError(
                        f"{demos.path} and {modes[episode.control_mode][0].path} both hold seed {episode.episode_seed} "
                        f"in {episode.control_mode}; name one of the files"
                    )
                modes[episode.control_mode] = demos, episode
        self._actions = np.zeros((0, 8))

    def reset(self, *, task: str, instruction: str, seed: int, action_space: ActionSpace) -> None:
        """Look the episode up.

        Raises:
          InputError: It was not recorded, or in other control modes, with another object, or its actions are changes at
            another rate.
        """
        if (task, seed) not in self._episodes:
            raise self._not_recorded(task, seed)
        modes = self._episodes[task, seed]
        if action_space.control_mode not in modes:
            path = next(iter(modes.values()))[0].path
            raise InputError(
                f"{path}: its actions are {' or '.join(modes)}; add --control-mode {next(iter(modes))}"
            )
        demos, episode = modes[action_space.control_mode]
        if instruction != episode.instruction:
            objects = " ".join(demos.env_kwargs.get("objects") or ())
            raise InputError(
                f"{demos.path}: seed {seed} was recorded with {episode.object} ({episode.instruction!r}), this episode asks "
                f"{instruction!r}; expected {f'--objects {brief(objects)}' if objects else 'no --objects'}, as recorded"
            )
        if episode.control_mode not in ABSOLUTE and action_space.hz != RECORDED_HZ:
            raise InputError(
                f"{demos.path}: its actions are changes ({episode.control_mode}), {RECORDED_HZ} a second; none can be "
                f"left out: add --hz {RECORDED_HZ}"
            )
        self._actions = slowed(read_actions(demos, episode), action_space.hz)

    def infer(self, obs: Mapping[str, Any]) -> dict[str, Any]:
        """All actions."""
        return {"actions": self._actions, "done": True}

    def _not_recorded(self, task: str, seed: int) -> InputError:
        """What can be played instead of an episode that nobody recorded."""
        said = f"{self._data}: holds no recording of {task}"
        count = sum(name == task for name, _ in self._episodes)
        if not count:
            return InputError(f"{said}; it has {', '.join(sorted({n for n, _ in self._episodes}))}")
        return InputError(
            f"{said} with seed {seed}, but {count} with others; take the recording's --seed and at most {count} --episodes, "
            "fewer where attempts failed (--failures keeps those), or add some by `manipose demos record --resume`"
        )


def slowed(actions: Float[np.ndarray, "t n"], hz: float) -> Float[np.ndarray, "s n"]:
    """Every so-manieth target: of each period the last, where the arm shall be at its end.

    Args:
      actions: At the rate of recordings.
      hz: At which targets shall follow each other.
    """
    count = int(np.ceil(len(actions) * hz / RECORDED_HZ))
    ends = np.round((1 + np.arange(count)) * RECORDED_HZ / hz).astype(int) - 1
    return actions[np.clip(ends, 0, len(actions) - 1)]
