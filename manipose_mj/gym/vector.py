"""Many environments at once, each in a process of its own."""

from __future__ import annotations

from functools import partial
from typing import Any

from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv, VectorEnv

from manipose_mj.errors import InputError
from manipose_mj.gym.env import ManiPoseEnv
from manipose_mj.tasks.core.registry import named_task


def make_vector(num_envs: int = 1, **arguments: Any) -> VectorEnv:
    """What `gymnasium.make_vec` gives for our ids.

    Workers are spawned, not forked: renderers and JAX survive no fork. They build the task from its
    factory, so that tasks of other packages work in them too. Infos are batched as Gymnasium does.

    Args:
      num_envs: How many; one runs in this process.
      **arguments: Of `ManiPoseEnv`.

    Raises:
      InputError: There would be none.
    """
    if num_envs < 1:
        raise InputError(f"num_envs is {num_envs}; expected at least 1")
    if isinstance(task := arguments.pop("task"), str):
        task = named_task(task)
    make = partial(ManiPoseEnv, task, **arguments)
    if num_envs == 1:
        return SyncVectorEnv([make])
    return AsyncVectorEnv([make] * num_envs, context="spawn")
