"""Load tasks by name: `suite.load("articulated", "store_chips_can_middle_drawer", seed=0)`."""

from __future__ import annotations

import types
from collections.abc import Sequence
from typing import Any

import numpy as np
from dm_control import composer

from asset_pipeline.assets import Asset
from asset_pipeline.catalogue import Split
from manipose_mj.tasks import builtin  # noqa: F401  (registers the tasks)
from manipose_mj.tasks.observations import SensorConfig
from manipose_mj.tasks.options import Reward, TaskOptions
from manipose_mj.tasks.registry import all_tasks, task_spec

ALL_TASKS: tuple[tuple[str, str], ...] = all_tasks()


def load(
    domain: str,
    task: str,
    seed: int | np.random.RandomState | None = None,
    *,
    observations: str = "state+pose",
    sensors: SensorConfig | None = None,
    objects: Sequence[Asset] | None = None,
    split: Split = "train",
    reward: Reward = "sparse",
    randomisation: str = "none",
    environment_kwargs: dict[str, Any] | None = None,
) -> composer.Environment:
    """The environment of a registered task.

    Args:
      domain: `"single_object"` or `"articulated"`.
      task: A task of that domain, as in `ALL_TASKS`.
      seed: Of the environment's one random state; episodes follow from it.
      observations: Any `+` combination of `state`, `pose`, `depth`, `segmentation`, `pointcloud`.
      sensors: Cameras, image size and cloud size.
      objects: Assets to use instead of the built-in ones.
      split: Which built-in objects, train or test.
      reward: `"sparse"` or `"dense"`.
      randomisation: Strength of domain randomisation.
      environment_kwargs: More arguments of `composer.Environment`.

    Raises:
      InputError: An unknown task or observation mode, or objects that the task cannot use.
    """
    options = TaskOptions(
        observations=observations,
        sensors=sensors or SensorConfig(),
        objects=None if objects is None else tuple(objects),
        split=split,
        reward=reward,
        randomisation=randomisation,
    )
    built = task_spec(domain, task).factory(options)
    arguments: dict[str, Any] = {
        "time_limit": built.config.horizon,
        "random_state": seed,
        "strip_singleton_obs_buffer_dim": True,
        "recompile_mjcf_every_episode": False,
    }
    return composer.Environment(built, **{**arguments, **(environment_kwargs or {})})


def describe(domain: str, task: str) -> str:
    """One line on what the task asks for."""
    return task_spec(domain, task).summary


def register_suite() -> None:
    """Make `dm_control.suite.load(domain, task)` know our tasks; calling it again changes nothing."""
    from dm_control import suite as dm_suite
    from dm_control.utils import containers

    for domain in {domain for domain, _ in ALL_TASKS}:
        tasks = containers.TaggedTasks()
        for name in [name for other, name in ALL_TASKS if other == domain]:
            tasks.add(*task_spec(domain, name).tags)(_suite_factory(domain, name))
        module: Any = types.ModuleType(f"{__name__}.{domain}")
        module.SUITE = tasks
        dm_suite._DOMAINS[domain] = module
    ours = tuple(task for task in ALL_TASKS if task not in dm_suite.ALL_TASKS)
    dm_suite.ALL_TASKS = (*dm_suite.ALL_TASKS, *ours)


def _suite_factory(domain: str, name: str) -> Any:
    """A factory with the signature that `dm_control.suite` calls."""

    def factory(
        time_limit: float | None = None,
        random: int | np.random.RandomState | None = None,
        environment_kwargs: dict[str, Any] | None = None,
        **task_kwargs: Any,
    ) -> composer.Environment:
        more = dict(environment_kwargs or {})
        if time_limit is not None:
            more["time_limit"] = time_limit
        return load(domain, name, random, environment_kwargs=more, **task_kwargs)

    factory.__name__ = name
    return factory
