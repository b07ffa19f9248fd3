"""Registering tasks for the length of a test, and one task that diverges on purpose."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import gymnasium
import numpy as np
from dm_control import suite as dm_suite

from manipose_mj import register_task
from manipose_mj.assets import catalogue
from manipose_mj.gym import env_id
from manipose_mj.poses import compose
from manipose_mj.tasks.core import registry
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, TaskConfig
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.core.start import EpisodeStart, PlacedObject
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.goals import OnTableGoal, PoseGoal

FATAL_STEP = 3


class Diverging(ManipulationTask):
    """Its simulation breaks in the first episode, at the third control step, and never again."""

    def __init__(self, env_config: EnvConfig) -> None:
        super().__init__(TaskConfig(horizon=0.4), env_config)
        self.asset = catalogue.load("box", 0)
        self.scene.add_objects([self.asset])
        self.episodes = self.steps = 0

    def sample(self, rng, spec: EpisodeSpec, preview: Preview) -> EpisodeStart:
        self.episodes, self.steps = self.episodes + 1, 0
        rest = self.asset.stable_poses[0]
        x, y = rng.uniform([0.4, -0.2], [0.6, 0.2])
        pose = compose(rest.rotation, np.array([x, y, rest.height]))
        goal = PoseGoal("object", compose(np.eye(3), np.array([0.5, 0.0, 0.1])))
        return EpisodeStart(
            goals=(goal, OnTableGoal("object")), objects={"object": PlacedObject(0, pose)}
        )

    def before_step(self, physics, action, random_state) -> None:
        super().before_step(physics, action, random_state)
        self.steps += 1
        if self.episodes == 1 and self.steps == FATAL_STEP:
            physics.data.qvel[:] = 1e11


def diverging(env_config: EnvConfig) -> Diverging:
    """Break the simulation."""
    return Diverging(env_config)


@contextmanager
def registered(name: str, factory) -> Iterator[tuple[str, str]]:
    """The factory as the task `example/name`, and none of it left behind."""
    register_task("example", name)(factory)
    try:
        yield "example", name
    finally:
        forget("example", name)


def forget(domain: str, name: str) -> None:
    """Undo a registration at every front door."""
    del registry._TASKS[domain, name]
    gymnasium.registry.pop(env_id(name), None)
    dm_suite._DOMAINS.pop(domain, None)
    dm_suite.TASKS_BY_DOMAIN.pop(domain, None)
    dm_suite.ALL_TASKS = tuple(t for t in dm_suite.ALL_TASKS if t != (domain, name))
