"""What all tasks share: the table, the robot, sensors, actions, contact bookkeeping, success once."""

from __future__ import annotations

import abc
from collections import OrderedDict
from collections.abc import Mapping

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer.observation import observable
from dm_env import specs
from jaxtyping import Bool, Float, Int

from manipose_mj.mjcf.arena import TableArena
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.mjcf.panda import HOME, MAX_OPENING, Panda
from manipose_mj.poses import pose_error
from manipose_mj.tasks.action_mode import checked_action
from manipose_mj.tasks.goals import Goal, PoseGoal, all_met
from manipose_mj.tasks.observations import SensorObservables, parse_modes
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.randomisation import Delay, Randomiser, randomisation
from manipose_mj.tasks.scene_state import ObjectState, PartState, SceneState
from manipose_mj.tasks.shaping import dense_reward

CONTROL_TIMESTEP = 0.02
SETTLE_TIME = 0.3


class ManipulationTask(composer.Task):
    """A table, a Panda at its edge, and whatever the subclass puts on the table.

    Subclasses fill `self._instances` (what segmentation tells apart), then call `_finish_build`.
    """

    @abc.abstractmethod
    def __init__(self, config: TaskConfig, options: TaskOptions) -> None:
        self.config = config
        self.options = options
        self._arena = TableArena()
        self.robot = Panda()
        self._arena.attach(self.robot)
        self._instances: dict[str, composer.Entity] = {"robot": self.robot}
        self._task_observables: OrderedDict[str, observable.Observable] = OrderedDict()
        self.control_timestep = CONTROL_TIMESTEP
        self.success_now = self.success_once = False
        self.max_penetration = 0.0
        self._owners: dict[composer.Entity, Int[np.ndarray, "ngeom"]] = {}
        self._substep = 0
        self._randomiser = Randomiser(randomisation(options.randomisation))
        self._delay = Delay()

    def _finish_build(self, pose_observables: Mapping[str, observable.Observable]) -> None:
        """Add the observables; call once the scene is complete."""
        options = self.options
        self._sensors = SensorObservables(self._instances, self._arena, options.sensors)
        self._task_observables = self._sensors.build(options.observations, pose_observables)
        if "state" in parse_modes(options.observations):
            self.robot.observables.enable_all()

    # What a subclass says about its goal.

    @property
    @abc.abstractmethod
    def goals(self) -> tuple[Goal, ...]:
        """What this episode wants, all of it; for a planner too."""

    @property
    @abc.abstractmethod
    def movable(self) -> dict[str, RigidObject]:
        """The rigid objects in play, by the names that goals use."""

    @property
    def furnishings(self) -> tuple[ArticulatedObject, ...]:
        """The articulated objects in play; no two have parts of one name."""
        return ()

    @property
    @abc.abstractmethod
    def object_name(self) -> str:
        """The asset that this episode is about."""

    @abc.abstractmethod
    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        """Put objects and goal where the episode starts; the robot is home already."""

    # Success

    def scene_state(self, physics: mjcf.Physics) -> SceneState:
        """The state that goals and rewards are functions of."""
        touched, held = self._touching(physics)
        objects = {}
        for name, entity in self.movable.items():
            linear, angular = entity.speeds(physics)
            objects[name] = ObjectState(
                label=entity.asset.label,
                label_pose=entity.label_pose(physics),
                linear_speed=np.asarray(linear),
                angular_speed=np.asarray(angular),
                touched=np.asarray(bool(self._geoms_of(physics, entity)[touched].any())),
                held=np.asarray(all(self._geoms_of(physics, entity)[g].any() for g in held)),
            )
        parts = {}
        for furniture in self.furnishings:
            for part in furniture.asset.parts:
                pose = furniture.part_pose(physics, part.name)
                parts[part.name] = PartState(
                    part=part,
                    opening=np.asarray(furniture.opening(physics, part.name)),
                    handle_pose=furniture.handle_pose(physics, part.name) if part.handle else pose,
                    cavity_pose=furniture.cavity_pose(physics, part.name) if part.cavity else pose,
                    touched=np.asarray(
                        bool(np.isin(touched, furniture.part_geoms(physics, part.name)).any())
                    ),
                )
        return SceneState(
            tcp_pose=self.robot.tcp_pose(physics),
            gripper=np.asarray(self.robot.configuration(physics)[1]),
            objects=objects,
            parts=parts,
        )

    def succeeded(self, physics: mjcf.Physics) -> bool:
        """Whether all goals are met now."""
        return bool(all_met(self.goals, self.scene_state(physics), self.config.tolerance))

    def goal_error(self, physics: mjcf.Physics) -> tuple[float, float] | None:
        """The largest translation [m] and rotation [rad] error to a goal pose; None without one."""
        errors = [
            pose_error(
                self.movable[goal.object].label_pose(physics),
                goal.pose,
                self.movable[goal.object].asset.label.symmetry,
            )
            for goal in self.goals
            if isinstance(goal, PoseGoal)
        ]
        if not errors:
            return None
        return float(max(e[0] for e in errors)), float(max(e[1] for e in errors))

    def forget_images(self) -> None:
        """Drop what was rendered: the state has been changed from outside."""
        self._sensors.forget()

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
        return self.options.action_mode.spec()

    def initialize_episode_mjcf(self, random_state: np.random.RandomState) -> None:
        self._owners.clear()

    def initialize_episode(
        self, physics: mjcf.Physics, random_state: np.random.RandomState
    ) -> None:
        self._sensors.forget()
        latency = 0.0
        if self._randomiser.active:
            latency = self._randomise(physics, random_state)
        self.robot.set_configuration(physics, HOME, MAX_OPENING)
        self._delay.start(round(latency / self.physics_timestep), np.append(HOME, MAX_OPENING))
        self.place_objects(physics, random_state)
        # dm_control's step begins with the second half of the last one.
        physics.forward()
        physics.step(round(SETTLE_TIME / self.physics_timestep))
        physics.data.time = 0.0
        self.options.action_mode.reset(physics, self.robot)
        self.success_now = self.success_once = False
        self.max_penetration = 0.0

    def before_step(
        self,
        physics: mjcf.Physics,
        action: Float[np.ndarray, "n"],
        random_state: np.random.RandomState,
    ) -> None:
        mode = self.options.action_mode
        mode.begin(physics, self.robot, checked_action(mode, action))
        self._substep = 0

    def before_substep(
        self,
        physics: mjcf.Physics,
        action: Float[np.ndarray, "n"],
        random_state: np.random.RandomState,
    ) -> None:
        self._substep += 1
        share = self._substep / self.physics_steps_per_control_step
        joints, opening = self.options.action_mode.targets(physics, self.robot, share)
        arrived = self._delay.through(np.append(joints, opening))
        self.robot.apply_targets(physics, arrived[:7], float(arrived[7]))

    def after_substep(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        if physics.data.ncon:
            self.max_penetration = max(
                self.max_penetration, -float(physics.data.contact.dist.min())
            )

    def after_step(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        self.success_now = self.succeeded(physics)
        self.success_once = self.success_once or self.success_now

    def get_reward(self, physics: mjcf.Physics) -> float:
        if self.options.reward == "sparse" or self.success_now:
            return float(self.success_now)
        state = self.scene_state(physics)
        return min(float(dense_reward(self.goals, state, self.config.tolerance)), 0.999)

    def _randomise(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> float:
        objects = [e for e in self._instances.values() if isinstance(e, RigidObject)]
        pads = np.asarray(physics.bind(self.robot.pad_geoms).element_id)
        return self._randomiser.apply(physics, objects, pads.tolist(), random_state)

    # Contacts

    def _geoms_of(self, physics: mjcf.Physics, entity: composer.Entity) -> Bool[np.ndarray, "g"]:
        """A mask over geom ids, `(ngeom,)`, looked up once per compiled model."""
        if entity not in self._owners:
            mask = np.zeros(physics.model.ngeom, bool)
            mask[physics.bind(entity.mjcf_model.find_all("geom")).element_id] = True
            self._owners[entity] = mask
        return self._owners[entity]

    def _touching(
        self, physics: mjcf.Physics
    ) -> tuple[Int[np.ndarray, "n"], tuple[Int[np.ndarray, "a"], Int[np.ndarray, "b"]]]:
        """Ids of the geoms that the robot touches; and those that its left and right pad touch."""
        contact = physics.data.contact
        pairs = np.concatenate([contact.geom, contact.geom[:, ::-1]])
        touching = pairs[self._geoms_of(physics, self.robot)[pairs[:, 0]]]
        left, right = physics.bind(self.robot.pad_geoms).element_id
        return touching[:, 1], (
            touching[touching[:, 0] == left, 1],
            touching[touching[:, 0] == right, 1],
        )

    def touches_robot(self, physics: mjcf.Physics, entity: composer.Entity) -> bool:
        """Whether any geom of the robot touches any geom of the entity."""
        return bool(self._geoms_of(physics, entity)[self._touching(physics)[0]].any())
