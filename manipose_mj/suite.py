"""Load tasks by name: `suite.load("articulated", "store_chips_can_middle_drawer", seed=0)`."""

from __future__ import annotations

import types
from collections.abc import Sequence
from functools import partial
from typing import Any

import dm_env
import numpy as np
from dm_control import composer

from asset_pipeline.assets import Asset
from asset_pipeline.catalogue import Split
from manipose_mj.errors import unknown_name
from manipose_mj.tasks import builtin  # noqa: F401  (registers the tasks)
from manipose_mj.tasks.environment import TaskEnvironment
from manipose_mj.tasks.observations import SensorConfig
from manipose_mj.tasks.options import Reward, TaskOptions
from manipose_mj.tasks.registry import TaskSpec, all_tasks, on_registration, task_spec

ALL_TASKS: tuple[tuple[str, str], ...]  # always those of now: see __getattr__


def __getattr__(name: str) -> Any:
    if name == "ALL_TASKS":
        return all_tasks()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def load(
    domain: str,
    task: str,
    seed: int | np.random.RandomState | None = None,
    *,
    observations: str = "state+pose",
    sensors: SensorConfig | None = None,
    control_mode: str = "pd_joint_pos",
    objects: Sequence[Asset] | None = None,
    split: Split = "train",
    reward: Reward = "sparse",
    randomisation: str = "none",
    environment_kwargs: dict[str, Any] | None = None,
) -> composer.Environment:
    """The environment of a registered task.

    Args:
      domain: `"single_object"`, `"clutter"`, `"articulated"`, or one of your own.
      task: A task of that domain, as in `ALL_TASKS`.
      seed: Of the environment's one random state; episodes follow from it.
      observations: Any `+` combination of observation modes, such as `"state+pose+pointcloud"`.
      sensors: Cameras, image size and cloud size.
      control_mode: What actions mean, such as `"pd_joint_pos"`, `"pd_ee_delta_pose"` or `"primitive"`;
        the physics is the same for all.
      objects: Assets to use instead of the built-in ones.
      split: Which built-in objects, train or test.
      reward: `"sparse"` or `"dense"`.
      randomisation: Strength of domain randomisation.
      environment_kwargs: More arguments of `composer.Environment`.

    Raises:
      InputError: An unknown task, observation or control mode, or objects that the task cannot use.
    """
    spec = task_spec(domain, task)
    return load_spec(
        spec,
        seed,
        observations=observations,
        sensors=sensors or SensorConfig(),
        control_mode=control_mode,
        objects=None if objects is None else tuple(objects),
        split=split,
        reward=reward,
        randomisation=randomisation,
        environment_kwargs=environment_kwargs or {},
    )


def load_spec(
    spec: TaskSpec,
    seed: int | np.random.RandomState | None,
    *,
    control_mode: str,
    environment_kwargs: dict[str, Any],
    **options: Any,
) -> composer.Environment:
    """The environment of a task that need not be registered in this process; arguments as for `load`."""
    from manipose_mj.control.modes import CONTROL_MODES
    from manipose_mj.control.modes import control_mode as mode_named

    if control_mode not in (*CONTROL_MODES, "primitive"):
        raise unknown_name("control mode", control_mode, (*CONTROL_MODES, "primitive"))
    if control_mode == "primitive":
        from manipose_mj.control.modes.primitive import PrimitiveEnvironment

        moving = load_spec(
            spec,
            seed,
            control_mode="pd_joint_pos",
            environment_kwargs=environment_kwargs,
            **options,
        )
        return PrimitiveEnvironment(moving)
    task = spec.factory(TaskOptions(action_mode=mode_named(control_mode), **options))
    again = partial(
        load_spec,
        spec,
        None,
        control_mode=control_mode,
        environment_kwargs=environment_kwargs,
        **options,
    )
    arguments: dict[str, Any] = {
        "time_limit": task.config.horizon,
        "random_state": seed,
        "strip_singleton_obs_buffer_dim": True,
        "recompile_mjcf_every_episode": False,
    }
    return TaskEnvironment(task, rebuild=again, **{**arguments, **environment_kwargs})


def describe(domain: str, task: str) -> str:
    """One line on what the task asks for."""
    return task_spec(domain, task).summary


def register_suite() -> None:
    """Make `dm_control.suite.load(domain, task)` know our tasks, and those registered later.

    Calling it again changes nothing.
    """
    on_registration(_add_to_dm_control)


def _add_to_dm_control(spec: TaskSpec) -> None:
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


def _suite_factory(spec: TaskSpec) -> Any:
    """A factory with the signature that `dm_control.suite` calls."""

    def factory(
        time_limit: float | None = None,
        random: int | np.random.RandomState | None = None,
        environment_kwargs: dict[str, Any] | None = None,
        **task_kwargs: Any,
    ) -> dm_env.Environment:
        more = dict(environment_kwargs or {})
        if time_limit is not None:
            more["time_limit"] = time_limit
        return load(spec.domain, spec.name, random, environment_kwargs=more, **task_kwargs)

    factory.__name__ = spec.name
    return factory
