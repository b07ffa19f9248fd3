"""Saving an episode at any step and going on from there, bit for bit."""

from __future__ import annotations

import copy
from dataclasses import dataclass, is_dataclass
from typing import Any

import mujoco
import numpy as np
from dm_control import composer
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.core.scene_objects import SceneObjects
from manipose_mj.tasks.core.simulation_state import (
    SimulationState,
    read_simulation,
    state_size,
    write_simulation,
)
from manipose_mj.tasks.core.task import ManipulationTask

# What an episode may change in a model: where fixed things stand, who has weight, randomisation.
MODEL_FIELDS = (
    "body_pos",
    "body_quat",
    "body_ipos",
    "body_iquat",
    "body_mass",
    "body_inertia",
    "body_subtreemass",
    "body_invweight0",
    "body_gravcomp",
    "geom_friction",
    "geom_solref",
    "geom_rgba",
    "geom_matid",
    "mat_rgba",
    "dof_damping",
    "dof_frictionloss",
    "dof_invweight0",
    "dof_M0",
    "actuator_gainprm",
    "actuator_biasprm",
    "light_pos",
    "light_dir",
    "light_diffuse",
    "light_ambient",
    "light_specular",
    "cam_pos",
    "cam_quat",
    "cam_fovy",
)


# Of a task, what the environment was made with.
_OWN = ("env_config", "config", "task_config", "_action_shape")


@dataclass(frozen=True)
class Snapshot:
    """All that the rest of an episode depends on; arrays and plain values, so it can be pickled.

    Attributes:
      simulation: All of MuJoCo's data that count.
      model: Fields of the model that an episode may change.
      memory: What the control mode remembers.
      task: What the task remembers of this episode.
      random_state: Of the environment's one generator.
      ended: Whether the episode was over.
      failure, failure_reason: Of the environment.
      options: What environments must share for the rest of an episode to be the same: the task's name, its control
        mode, randomisation and latency.
      objects: Of the scene; None where all episodes have the same.
    """

    simulation: SimulationState
    model: dict[str, np.ndarray]
    memory: Float[np.ndarray, "m"]
    task: dict[str, Any]
    random_state: Any
    ended: bool
    failure: str
    failure_reason: str
    options: dict[str, Any]
    objects: SceneObjects | None = None


def save(environment: composer.Environment) -> Snapshot:
    """The environment's present, between two steps.

    Raises:
      InputError: It has not been reset yet.
    """
    task, model, data = _parts(environment)
    return Snapshot(
        simulation=read_simulation(model, data),
        model={name: np.array(getattr(model, name)) for name in MODEL_FIELDS},
        memory=task.control_mode.memory(),
        task={k: copy.deepcopy(v) for k, v in vars(task).items() if k not in _OWN and _is_plain(v)},
        random_state=environment.random_state.get_state(),
        ended=environment._reset_next_step,
        failure=getattr(environment, "failure", ""),
        failure_reason=getattr(environment, "failure_reason", ""),
        options=_options(task),
        objects=getattr(environment, "scene_objects", None),
    )


def restore(environment: composer.Environment, snapshot: Snapshot) -> dict[str, np.ndarray]:
    """Put an environment of the same task and options back; what follows is the same.

    Observations and rewards are of the environment's own modes.

    Returns:
      The observation of that moment.

    Raises:
      InputError: The environment has not been reset yet, is of another task or has other options, or its model is
        another one.
    """
    task, model, data = _parts(environment)
    for name, value in _options(task).items():
        if snapshot.options[name] != value:
            raise InputError(
                f"snapshot with {name} {snapshot.options[name]!r}; this environment has {value!r}: restore it in one "
                f"of {snapshot.options['task']} with the same options"
            )
    if snapshot.objects is not None and isinstance(environment, TaskEnvironment):
        environment.use(snapshot.objects)
        task, model, data = _parts(environment)
    expected, found = state_size(model), len(snapshot.simulation.state)
    shapes = {name: getattr(model, name).shape for name in MODEL_FIELDS}
    if found != expected or any(
        snapshot.model[name].shape != shape for name, shape in shapes.items()
    ):
        raise InputError(
            f"snapshot of {found} state values; this environment has {expected}: "
            f"restore it in one of {snapshot.options['task']} with the same options"
        )
    for name, values in snapshot.model.items():
        getattr(model, name)[:] = values
    write_simulation(model, data, snapshot.simulation)
    task.__dict__.update(copy.deepcopy(snapshot.task))
    task.control_mode.remember(snapshot.memory)
    task.forget_images()
    updater = environment._observation_updater
    environment.random_state.set_state(snapshot.random_state)
    updater.reset(environment.physics, environment.random_state)
    # Observations may have drawn noise.
    environment.random_state.set_state(snapshot.random_state)
    environment._reset_next_step = snapshot.ended
    observation = updater.get_observation()
    if isinstance(environment, TaskEnvironment):
        environment.go_on(observation, snapshot.failure, snapshot.failure_reason)
    return observation


def _options(task: ManipulationTask) -> dict[str, Any]:
    own = task.env_config
    return {
        "task": own.task,
        "control mode": task.control_mode.name,
        "randomisation": own.randomisation,
        "latency": own.latency,
    }


def _parts(
    environment: composer.Environment,
) -> tuple[ManipulationTask, mujoco.MjModel, mujoco.MjData]:
    if not isinstance(environment, composer.Environment):
        kind = type(environment).__name__
        raise InputError(f"{kind} is saved and restored by its own methods save and restore")
    task = environment.task
    if not isinstance(task, ManipulationTask):
        raise InputError(f"{type(task).__name__} is no task of this package; it cannot be saved")
    if environment._mjcf_never_compiled:
        raise InputError("the environment has not been reset yet; call reset() first")
    return task, environment.physics.model.ptr, environment.physics.data.ptr


def _is_plain(value: Any) -> bool:
    """Whether it is data: what an episode leaves in a task, not the scene's elements."""
    if value is None or isinstance(value, (bool, int, float, str, np.ndarray, np.generic)):
        return True
    if isinstance(value, (tuple, list)):
        return all(_is_plain(v) for v in value)
    if isinstance(value, dict):
        return all(isinstance(k, str) and _is_plain(v) for k, v in value.items())
    return is_dataclass(value) and all(_is_plain(v) for v in vars(value).values())
