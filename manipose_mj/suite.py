"""Load tasks by name: `suite.load("articulated", "store_chips_can_middle_drawer", seed=0)`."""

from __future__ import annotations

import inspect
import math
import types
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Unpack

import dm_env
import numpy as np
from dm_control import composer

from manipose_mj.errors import InputError, brief, unknown_name
from manipose_mj.tasks import registered  # noqa: F401  (registers the tasks)
from manipose_mj.tasks.core.config import PRIMITIVE, EnvConfig, EnvOptions, check_seed, env_config
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.core.registry import (
    TaskSpec,
    all_tasks,
    named_task,
    on_registration,
    task_spec,
)
from manipose_mj.tasks.core.scene_source import SceneSource

ALL_TASKS: tuple[tuple[str, str], ...]  # always those of now: see __getattr__


def __getattr__(name: str) -> Any:
    if name == "ALL_TASKS":
        return all_tasks()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def load(
    domain: str,
    task: str | None = None,
    seed: int | np.random.RandomState | None = None,
    *,
    environment_kwargs: dict[str, Any] | None = None,
    **config: Unpack[EnvOptions],
) -> composer.Environment:
    """The environment of a registered task.

    Args:
      domain: `"single_object"`, `"clutter"`, `"articulated"`, or one of your own.
      task: A task of that domain, as in `ALL_TASKS`.
      seed: Of the environment's one random state; episodes follow from it.
      environment_kwargs: More arguments of `composer.Environment`, such as `time_limit` [s].
      **config: Fields of `EnvConfig`: `obs_mode`, `control_mode`, `reward_mode`, `objects`, `split`,
        `randomisation`, `sensors`, `latency`.

    Raises:
      InputError: No domain and task, an unknown task, observation or control mode, objects that the task cannot use, a number that is no
        seed, or an argument that `composer.Environment` does not have or that `seed` stands for.
    """
    if not isinstance(domain, str) or task is None:
        raise InputError(
            f'load got {brief(domain)} and {brief(task)}; expected load("single_object", "target_pose"), '
            'or make(EnvConfig("single_object/target_pose"))'
        )
    spec = task_spec(domain, task)
    described = env_config(spec.full_name, config, others=("seed", "environment_kwargs"))
    return make(described, seed, environment_kwargs=environment_kwargs)


def make(
    config: EnvConfig,
    seed: int | np.random.RandomState | None = None,
    *,
    environment_kwargs: dict[str, Any] | None = None,
) -> composer.Environment:
    """The environment that a configuration describes; arguments and errors as for `load`."""
    if not isinstance(config, EnvConfig):
        raise InputError(
            f"make got {brief(config)}; expected an EnvConfig, as EnvConfig('single_object/target_pose')"
        )
    spec = named_task(config.task)
    _check_arguments({} if environment_kwargs is None else environment_kwargs)
    if seed is not None and not isinstance(seed, np.random.RandomState):
        check_seed(seed)
    return _made(spec, config, seed, environment_kwargs or {})


def _check_arguments(given: Any) -> None:
    if not isinstance(given, Mapping):
        raise InputError(f"environment_kwargs is {brief(given)}; expected a mapping of names")
    known = inspect.signature(composer.Environment).parameters.keys() - {"task", "random_state"}
    for name in given:
        if name == "random_state":
            raise InputError("environment_kwargs has random_state; give it as seed")
        if name not in known:
            raise unknown_name("argument of an environment", name, known)
    limit = given.get("time_limit", math.inf)
    number = isinstance(limit, int | float | np.number) and not isinstance(limit, bool)
    if not number or not limit > 0:
        raise InputError(f"time_limit is {brief(limit)} s; expected a number above 0")


def _made(
    spec: TaskSpec,
    config: EnvConfig,
    seed: int | np.random.RandomState | None,
    environment_kwargs: dict[str, Any],
) -> composer.Environment:
    if config.control_mode == PRIMITIVE:
        from manipose_mj.control.primitive_mode.environment import PrimitiveEnvironment

        moving = replace(config, control_mode="pd_joint_pos")
        return PrimitiveEnvironment(_made(spec, moving, seed, environment_kwargs))
    arguments: dict[str, Any] = {
        "random_state": seed,
        "strip_singleton_obs_buffer_dim": True,
        "recompile_mjcf_every_episode": False,
    }
    # The specification knows its module: a process that loads a pickled environment registers the task.
    again = partial(_made, spec, config, None, environment_kwargs)
    scenes = SceneSource(spec, config)
    return TaskEnvironment(scenes, rebuild=again, **{**arguments, **environment_kwargs})


def describe(domain: str, task: str) -> str:
    """One line on what the task asks for."""
    return task_spec(domain, task).summary


def register_suite() -> None:
    """Make `dm_control.suite.load(domain, task)` know our tasks, and those registered later.

    Calling it again changes nothing.
    """
    on_registration(_DM_CONTROL)


class _DmControl:
    """`dm_control.suite`'s lists of tasks."""

    def check(self, spec: TaskSpec) -> None:
        from dm_control import suite as dm_suite

        module: Any = dm_suite._DOMAINS.get(spec.domain)
        if module is not None and spec.name in module.SUITE:
            raise ValueError(
                f"task {spec.full_name}: dm_control has a task of that name; choose another"
            )

    def add(self, spec: TaskSpec) -> None:
        from dm_control import suite as dm_suite
        from dm_control.utils import containers

        module: Any = dm_suite._DOMAINS.get(spec.domain)
        if module is None:
            module = types.ModuleType(f"{__name__}.{spec.domain}")
            module.SUITE = containers.TaggedTasks()
            dm_suite._DOMAINS[spec.domain] = module
        module.SUITE.add(*spec.tags)(_suite_factory(spec))
        dm_suite.ALL_TASKS = (*dm_suite.ALL_TASKS, (spec.domain, spec.name))
        dm_suite.TASKS_BY_DOMAIN[spec.domain] = tuple(module.SUITE)


_DM_CONTROL = _DmControl()


def _suite_factory(spec: TaskSpec) -> Any:
    """A factory with the signature that `dm_control.suite` calls."""

    def factory(
        time_limit: float | None = None,
        random: int | np.random.RandomState | None = None,
        environment_kwargs: dict[str, Any] | None = None,
        **task_kwargs: Any,
    ) -> dm_env.Environment:
        if "seed" in task_kwargs:
            raise InputError("task_kwargs has seed; give it as random")
        more = dict(environment_kwargs or {})
        if time_limit is not None:
            more["time_limit"] = time_limit
        return load(spec.domain, spec.name, random, environment_kwargs=more, **task_kwargs)

    factory.__name__ = spec.name
    return factory
