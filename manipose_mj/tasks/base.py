"""What all tasks share: the table, the robot, sensors, action, contact bookkeeping, success once."""

from __future__ import annotations

import abc
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer.observation import observable
from dm_env import specs
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.mjcf.arena import TableArena
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.mjcf.panda import HOME, MAX_OPENING, POSITION_LIMITS, Panda
from manipose_mj.tasks.goals import Goal
from manipose_mj.tasks.observations import SensorConfig, SensorObservables, parse_modes
from manipose_mj.tasks.success import Tolerance

CONTROL_TIMESTEP = 0.02
SETTLE_TIME = 0.3


@dataclass(frozen=True)
class TaskConfig:
    """What every task can be asked for.

    Attributes:
      observations: Any `+` combination of the observation modes.
      sensors: Cameras, image size and cloud size.
      tolerance: What counts as success.
      horizon: Time limit of an episode [s].
    """

    observations: str = "state+pose"
    sensors: SensorConfig = SensorConfig()
    tolerance: Tolerance = Tolerance()
    horizon: float = 60.0


class ManipulationTask(composer.Task):
    """A table, a Panda at its edge, and whatever the subclass puts on the table.

    The action is seven joint targets [rad] and the gripper's opening [m] (`pd_joint_pos`).
    Subclasses fill `self._instances` (what segmentation tells apart) before `_finish_build`.
    """

    @abc.abstractmethod
    def __init__(self, config: TaskConfig) -> None:
        self.config = config
        self._arena = TableArena()
        self.robot = Panda()
        self._arena.attach(self.robot)
        self._instances: dict[str, composer.Entity] = {"robot": self.robot}
        self._task_observables: OrderedDict[str, observable.Observable] = OrderedDict()
        self.control_timestep = CONTROL_TIMESTEP
        self.success_once = False
        self.max_penetration = 0.0
        self._geom_masks: dict[composer.Entity, np.ndarray] = {}

    def _finish_build(self, pose_observables: dict[str, observable.Observable]) -> None:
        """Add the observables; call once the scene is complete."""
        self._sensors = SensorObservables(self._instances, self._arena, self.config.sensors)
        self._task_observables = self._sensors.build(self.config.observations, pose_observables)
        if "state" in parse_modes(self.config.observations):
            self.robot.observables.enable_all()

    # What a subclass says about its goal.

    @abc.abstractmethod
    def succeeded(self, physics: mjcf.Physics) -> bool:
        """Whether the goal is met now."""

    @abc.abstractmethod
    def goal_error(self, physics: mjcf.Physics) -> tuple[float, float] | None:
        """Translation [m] and rotation [rad] error to the goal pose; None without a goal pose."""

    @property
    @abc.abstractmethod
    def goal(self) -> Goal:
        """What this episode wants, for a planner."""

    @property
    @abc.abstractmethod
    def movable(self) -> dict[str, RigidObject]:
        """The rigid objects in play, by the names that goals use."""

    @property
    def furnishings(self) -> tuple[ArticulatedObject, ...]:
        """The articulated objects in play."""
        return ()

    @property
    @abc.abstractmethod
    def object_name(self) -> str:
        """The asset that this episode is about."""

    @abc.abstractmethod
    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        """Put objects and goal where the episode starts; the robot is home already."""

    # composer.Task

    @property
    def root_entity(self) -> composer.Entity:
        return self._arena

    @property
    def task_observables(self) -> OrderedDict[str, observable.Observable]:
        return self._task_observables

    @property
    def instance_names(self) -> tuple[str, ...]:
        """What the ids of a segmentation stand for; 0 is everything else."""
        return ("background", *self._instances)

    def action_spec(self, physics: mjcf.Physics) -> specs.BoundedArray:
        minimum = np.append(POSITION_LIMITS[:, 0], 0.0)
        maximum = np.append(POSITION_LIMITS[:, 1], MAX_OPENING)
        return specs.BoundedArray((8,), np.float64, minimum, maximum, name="pd_joint_pos")

    def initialize_episode_mjcf(self, random_state: np.random.RandomState) -> None:
        self._geom_masks.clear()

    def initialize_episode(
        self, physics: mjcf.Physics, random_state: np.random.RandomState
    ) -> None:
        self._sensors.forget()
        self.robot.set_configuration(physics, HOME, MAX_OPENING)
        self.place_objects(physics, random_state)
        self.success_once = False
        # dm_control's step begins with the second half of the last one.
        physics.forward()
        physics.step(round(SETTLE_TIME / self.physics_timestep))
        physics.data.time = 0.0
        self.max_penetration = 0.0

    def before_step(
        self,
        physics: mjcf.Physics,
        action: Float[np.ndarray, "8"],
        random_state: np.random.RandomState,
    ) -> None:
        try:
            action = np.asarray(action, float)
        except (TypeError, ValueError):
            action = np.empty(0)
        if action.shape != (8,) or not np.isfinite(action).all():
            raise InputError(
                f"action has shape {action.shape} and values {action.ravel()[:8].tolist()}; "
                "expected 8 finite numbers: seven joint targets [rad] and an opening [m]"
            )
        self.robot.apply_targets(physics, action[:7], float(action[7]))

    def after_substep(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        if physics.data.ncon:
            self.max_penetration = max(
                self.max_penetration, -float(physics.data.contact.dist.min())
            )

    def after_step(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        self.success_now = self.succeeded(physics)
        self.success_once = self.success_once or self.success_now

    def get_reward(self, physics: mjcf.Physics) -> float:
        return float(self.success_now)

    def _geoms_of(self, physics: mjcf.Physics, entity: composer.Entity) -> np.ndarray:
        """A mask over geom ids, `(ngeom,)`, looked up once per compiled model."""
        if entity not in self._geom_masks:
            mask = np.zeros(physics.model.ngeom, bool)
            mask[physics.bind(entity.mjcf_model.find_all("geom")).element_id] = True
            self._geom_masks[entity] = mask
        return self._geom_masks[entity]

    def touches_robot(self, physics: mjcf.Physics, entity: composer.Entity) -> bool:
        """Whether any geom of the robot touches any geom of the entity."""
        contact = physics.data.contact
        own, robot = self._geoms_of(physics, entity), self._geoms_of(physics, self.robot)
        first, second = contact.geom1, contact.geom2
        return bool(np.any((robot[first] & own[second]) | (own[first] & robot[second])))
