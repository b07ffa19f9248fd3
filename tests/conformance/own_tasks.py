"""Registering tasks for the length of a test, and one task that diverges on purpose."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import gymnasium
import numpy as np
from dm_control import mjcf
from dm_control import suite as dm_suite

from asset_pipeline import catalogue
from manipose_mj import register_task
from manipose_mj.gym import env_id
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.poses import compose
from manipose_mj.tasks import registry
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.goals import OnTableGoal, PoseGoal
from manipose_mj.tasks.options import TaskConfig, TaskOptions

FATAL_STEP = 3


class Diverging(ManipulationTask):
    """Its simulation breaks in the first episode, at the third control step, and never again."""

    def __init__(self, options: TaskOptions) -> None:
        super().__init__(TaskConfig(horizon=0.4), options)
        self.object = RigidObject(catalogue.load("box", 0), name="object")
        self._arena.add_free_entity(self.object)
        self._instances["object"] = self.object
        self.episodes = self.steps = 0
        self._finish_build()

    @property
    def goals(self) -> tuple:
        return (
            PoseGoal("object", compose(np.eye(3), np.array([0.5, 0.0, 0.1]))),
            OnTableGoal("object"),
        )

    @property
    def movable(self) -> dict[str, RigidObject]:
        return {"object": self.object}

    @property
    def object_name(self) -> str:
        return self.object.asset.name

    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        self.episodes, self.steps = self.episodes + 1, 0
        rest = self.object.asset.stable_poses[0]
        x, y = random_state.uniform([0.4, -0.2], [0.6, 0.2])
        self.object.place(physics, compose(rest.rotation, np.array([x, y, rest.height])))

    def before_step(self, physics, action, random_state) -> None:
        super().before_step(physics, action, random_state)
        self.steps += 1
        if self.episodes == 1 and self.steps == FATAL_STEP:
            physics.data.qvel[:] = 1e11


def diverging(options: TaskOptions) -> Diverging:
    """Break the simulation."""
    return Diverging(options)


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
