"""What all tasks share: the table, the robot, sensors, actions, contact bookkeeping, success once."""

from __future__ import annotations

import abc
from collections import OrderedDict
from collections.abc import Mapping

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer.observation import observable
from dm_env import specs
from jaxtyping import Float

from manipose_mj.mjcf.arena import TableArena
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.mjcf.panda import HOME, MAX_OPENING, Panda
from manipose_mj.mjcf.sleep import static_things_moving
from manipose_mj.poses import pose_error
from manipose_mj.tasks.action_mode import checked_action
from manipose_mj.tasks.goals import Goal, PoseGoal, all_met
from manipose_mj.tasks.observations import SensorObservables, Slots
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.posed_things import Carried, wanted_poses
from manipose_mj.tasks.randomisation import Delay, Randomiser, randomisation
from manipose_mj.tasks.scene_reader import SceneReader
from manipose_mj.tasks.scene_state import SceneState
from manipose_mj.tasks.shaping import dense_reward

CONTROL_TIMESTEP = 0.02


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
        self._reader: SceneReader | None = None
        self._action_shape = options.action_mode.spec().shape
        self._substep, self._substeps = 0, 1
        self._randomiser = Randomiser(randomisation(options.randomisation))
        self._delay = Delay()
        self._target = np.zeros(8)
        self.noise_seed: int | None = None  # of the sensors, in this episode

    def _finish_build(
        self, pose_observables: Mapping[str, observable.Observable] | None = None
    ) -> None:
        """Add the observables; call once the scene is complete.

        Args:
          pose_observables: More for the mode `pose`; the poses of `movable`, of furniture and of goals
            are there anyway.
        """
        options = self.options
        furniture = (e for e in self._instances.values() if isinstance(e, ArticulatedObject))
        slots = Slots(self.object_slots, self.goal_slots, tuple(furniture))
        self._sensors = SensorObservables(
            self, slots, self._instances, self._arena, options.sensors, options.observations
        )
        self._task_observables = self._sensors.build(pose_observables or {})

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
    def object_slots(self) -> tuple[str, ...]:
        """Every name that `movable` has in any episode; observations are named for them."""
        return tuple(self.movable)

    @property
    def landmarks(self) -> Mapping[str, Carried]:
        """More frames to observe, such as those of the part in question; of one set of names."""
        return {}

    @property
    def goal_slots(self) -> tuple[str, ...]:
        """The observed goal poses of any episode: `goal` where there is one at most, else
        `goal_` and the object's name of each."""
        things = tuple(wanted_poses(self.goals, self.movable))
        return ("goal",) * len(things) if len(things) < 2 else tuple(f"goal_{n}" for n in things)

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
        if self._reader is None or not self._reader.reads(physics):
            objects = [e for e in self._instances.values() if isinstance(e, RigidObject)]
            pieces = [e for e in self._instances.values() if isinstance(e, ArticulatedObject)]
            self._reader = SceneReader(physics, self.robot, objects, pieces)
        return self._reader.read(physics, self.movable, self.furnishings)

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

    def close(self) -> None:
        """Free what the sensors hold."""
        self._sensors.close()

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

    def initialize_episode(
        self, physics: mjcf.Physics, random_state: np.random.RandomState
    ) -> None:
        self._sensors.forget()
        latency = 0.0
        if self._randomiser.active:
            latency = self._randomise(physics, random_state)
        self.robot.set_configuration(physics, HOME, MAX_OPENING)
        self._delay.start(round(latency / self.physics_timestep), np.append(HOME, MAX_OPENING))
        with static_things_moving(physics):
            self.place_objects(physics, random_state)
            # dm_control's step begins with the second half of the last one.
            physics.forward()
        physics.step(round(self.config.settle / self.physics_timestep))
        physics.data.time = 0.0
        self.options.action_mode.reset(physics, self.robot)
        self._action_shape = self.options.action_mode.spec().shape  # the mode may have been changed
        self._substeps = self.physics_steps_per_control_step
        self.success_now = self.success_once = False
        self.max_penetration = 0.0
        # Drawn whatever the sensors: the next episode shall not depend on what is observed.
        self.noise_seed = int(random_state.randint(2**31))
        self._sensors.forget()

    def before_step(
        self,
        physics: mjcf.Physics,
        action: Float[np.ndarray, "n"],
        random_state: np.random.RandomState,
    ) -> None:
        mode = self.options.action_mode
        mode.begin(physics, self.robot, checked_action(mode.name, self._action_shape, action))
        self._substep = 0

    def before_substep(
        self,
        physics: mjcf.Physics,
        action: Float[np.ndarray, "n"],
        random_state: np.random.RandomState,
    ) -> None:
        self._substep += 1
        share = self._substep / self._substeps
        target = self._target
        target[:7], target[7] = self.options.action_mode.targets(physics, self.robot, share)
        self.robot.follow_targets(physics, self._delay.through(target))

    def after_substep(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        data = physics.data.ptr
        if data.ncon:  # none are computed between things asleep
            self.max_penetration = max(self.max_penetration, -float(data.contact.dist.min()))

    def after_step(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        self.success_now = self.succeeded(physics)
        self.success_once = self.success_once or self.success_now

    def get_reward(self, physics: mjcf.Physics) -> float:
        if self.options.reward == "sparse" or self.success_now:
            return float(self.success_now)
        return self.reward_of(self.scene_state(physics), self.goals)

    def reward_of(self, state: SceneState, goals: tuple[Goal, ...]) -> float:
        """The reward, of this task's kind, of a state of its scene against any goals."""
        success = bool(all_met(goals, state, self.config.tolerance))
        if self.options.reward == "sparse" or success:
            return float(success)
        return min(float(dense_reward(goals, state, self.config.tolerance)), 0.999)

    def _randomise(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> float:
        objects = [e for e in self._instances.values() if isinstance(e, RigidObject)]
        pads = np.asarray(physics.bind(self.robot.pad_geoms).element_id)
        return self._randomiser.apply(physics, objects, pads.tolist(), random_state)

    def touches_robot(self, physics: mjcf.Physics, entity: composer.Entity) -> bool:
        """Whether any geom of the robot touches any geom of the entity."""
        geoms = physics.data.contact.geom
        own, robots = (
            np.isin(geoms, physics.bind(e.mjcf_model.find_all("geom")).element_id)
            for e in (entity, self.robot)
        )
        return bool(np.any(own[:, 0] & robots[:, 1] | own[:, 1] & robots[:, 0]))
