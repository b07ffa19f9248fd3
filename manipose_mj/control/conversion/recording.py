"""Recorded episodes: the actions of a control mode from the start state of a seed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from dm_control import composer
from jaxtyping import Float

from manipose_mj.actions import ControlMode, control_mode
from manipose_mj.tasks.core.task import ManipulationTask


@dataclass(frozen=True)
class Recording:
    """One episode of a task.

    Attributes:
      mode: Name of the control mode of the actions.
      seed: Of the environment; it fixes the start state.
      actions: One per control step, `(t, n)`.
      success: Whether the goal was met at the end.
    """

    mode: str
    seed: int
    actions: Float[np.ndarray, "t n"]
    success: bool


def record(
    environment: composer.Environment,
    actions: Iterable[Float[np.ndarray, "n"]],
    *,
    seed: int,
    mode: str = "pd_joint_pos",
) -> Recording:
    """Run an episode and keep its actions; it ends with them or with the task's horizon.

    Args:
      environment: Of one of this package's tasks.
      actions: Taken one at a time, the first after the reset: a policy may observe before each.
      seed: Of the start state.
      mode: What the actions mean.

    Raises:
      InputError: An unknown mode, or an action that does not fit it.
    """
    taken = []
    with acting(environment, mode, seed):
        for action in actions:
            taken.append(np.array(action, float))
            if environment.step(action).last():
                break
        return Recording(mode, seed, np.array(taken), task_of(environment).success_now)


def replay(environment: composer.Environment, recording: Recording) -> bool:
    """Whether the recording's actions meet the goal at the end."""
    again = record(environment, recording.actions, seed=recording.seed, mode=recording.mode)
    return again.success


@contextmanager
def acting(environment: composer.Environment, mode: str, seed: int) -> Iterator[ControlMode]:
    """At the start of the seed's episode, under a control mode until the end of the block.

    Raises:
      InputError: An unknown mode.
    """
    task = task_of(environment)
    usual, mine = task.control_mode, control_mode(mode)
    task.control_mode = mine
    try:
        environment.random_state.seed(seed)
        environment.reset()
        yield mine
    finally:
        task.control_mode = usual
        task_of(environment).control_mode = usual  # of the scene that the reset changed to


def task_of(environment: composer.Environment) -> ManipulationTask:
    """The environment's task, which must be one of this package's."""
    assert isinstance(environment.task, ManipulationTask)
    return environment.task
