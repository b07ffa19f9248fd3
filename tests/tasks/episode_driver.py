"""Start an episode of a task and move the arm in it: still, or slowly at random."""

from __future__ import annotations

import numpy as np
from dm_control import composer

from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.tasks.core.task import ManipulationTask

HOLD = np.append(HOME, MAX_OPENING)


def reset(environment: composer.Environment, seed: int) -> ManipulationTask:
    """The task, at the start of the episode of this seed."""
    environment.random_state.seed(seed)
    environment.reset()
    return environment.task


def hold(environment: composer.Environment, seconds: float) -> None:
    """Keep the arm at its home for a time [s]."""
    for _ in range(round(seconds / environment.control_timestep())):
        environment.step(HOLD)


def wander(environment: composer.Environment, count: int, seed: int) -> list[np.ndarray]:
    """`count` actions (8,) of a random walk from the arm's home: slow enough to follow."""
    rng, spec = np.random.default_rng(seed), environment.action_spec()
    steps = rng.normal(0, 1, (count, 8)) * ([0.05] * 7 + [0.01])
    return list(np.clip(HOLD + np.cumsum(steps, axis=0), spec.minimum, spec.maximum))
