"""Batched worlds with a few objects, and the CPU's environment of the same episodes."""

from __future__ import annotations

from typing import Any

import numpy as np
from dm_control import composer

from manipose_mj import batch
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.core.simulation_state import read_simulation
from tests.few_objects import few, load


def make(task: str, worlds: int = 2, **options: Any) -> batch.Worlds:
    """Worlds of the engine `c`, unless `options` says otherwise."""
    return batch.make(task, **{"worlds": worlds, "engine": "c", "objects": few(task), **options})


def wandering(steps: int, worlds: int, seed: int = 0) -> np.ndarray:
    """Joint targets that wander from home, which float32 holds exactly."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(0, 1, (steps, worlds, 8)) * ([0.08] * 7 + [0.01])
    return (np.append(HOME, MAX_OPENING) + np.cumsum(noise, axis=0)).astype(np.float32)


def on_the_cpu(task: str, seed: int, **options: Any) -> composer.Environment:
    """The environment at the start of the episode of a seed."""
    environment = load(*task.split("/"), seed=seed, **options)
    environment.reset(EpisodeSpec(seed=seed))
    return environment


def simulation_of(environment: composer.Environment) -> np.ndarray:
    """The state of its simulation."""
    physics = environment.physics
    return read_simulation(physics.model.ptr, physics.data.ptr).flat()
