"""Many environments at once, each in a process of its own."""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers import TimeLimit

from manipose_mj.errors import check_count, unknown_name
from manipose_mj.gym.env import ManiPoseEnv
from manipose_mj.tasks.core.registry import named_task


def make_vector(
    num_envs: int = 1,
    *,
    max_episode_steps: int | None = None,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    **arguments: Any,
) -> VectorEnv:
    """What `gymnasium.make_vec` gives for our ids.

    Workers are spawned, not forked: renderers and JAX survive no fork. They build the task from its
    factory, so that tasks of other packages work in them too. Infos are batched as Gymnasium does.

    Args:
      num_envs: How many; one runs in this process.
      max_episode_steps: Truncate episodes after so many actions, as `gymnasium.make` does.
      autoreset_mode: When an environment whose episode has ended begins the next: Gymnasium's.
      **arguments: Of `ManiPoseEnv`.

    Raises:
      InputError: There would be none, or no number of them, or an option is unknown.
    """
    check_count("num_envs", num_envs, least=1)
    if max_episode_steps is not None:
        check_count("max_episode_steps", max_episode_steps, least=1)
    try:
        autoreset = AutoresetMode(autoreset_mode)
    except ValueError:
        known = [mode.value for mode in AutoresetMode]
        raise unknown_name("autoreset mode", str(autoreset_mode), known) from None
    if isinstance(task := arguments.pop("task"), str):
        task = named_task(task)
    make = partial(_single, task, max_episode_steps, **arguments)
    if num_envs == 1:
        return SyncVectorEnv([make], autoreset_mode=autoreset)
    return AsyncVectorEnv([make] * int(num_envs), context="spawn", autoreset_mode=autoreset)


def _single(task: Any, max_episode_steps: int | None, **arguments: Any) -> gymnasium.Env:
    env = ManiPoseEnv(task, **arguments)
    return env if max_episode_steps is None else TimeLimit(env, max_episode_steps)
