"""The contract of a task: it builds a scene, draws starts and names goals; the rest is the same for all."""

from __future__ import annotations

import abc
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer.observation import observable
from dm_env import specs
from jaxtyping import Float

from manipose_mj import actions
from manipose_mj.errors import InputError
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.mjcf.sleep import sleep_disabled
from manipose_mj.poses import pose_error
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, TaskConfig
from manipose_mj.tasks.core.own_goal import with_goal
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.core.randomisation import Delay, Randomiser, randomisation, write_changes
from manipose_mj.tasks.core.scene import Scene
from manipose_mj.tasks.core.start import EpisodeStart, read_only
from manipose_mj.tasks.core.start_check import check_start
from manipose_mj.tasks.goals import Goal, PoseGoal, reward, success
from manipose_mj.tasks.observations.frames import BodyFrame
from manipose_mj.tasks.observations.sensors import SensorObservables, Slots
from manipose_mj.tasks.scene.reader import SceneReader
from manipose_mj.tasks.scene.state import SceneState

CONTROL_TIMESTEP = 0.02
SUCCESS_HELD = 0.5  # for how long a goal must hold until an evaluation may end an episode [s]


class ManipulationTask(composer.Task):
    """A table, a Panda at its edge, and whatever a subclass adds to the scene.

    A subclass adds objects, furniture and fixtures to `self.scene` in its constructor, and implements
    `sample`. What it may show beyond the first object it says in `observed_objects`, `observed_goals` and
    `extra_frames`.

    Attributes:
      config: What the task fixes about itself.
      env_config: What its user chose.
      scene: The world.
      robot: In it.
      control_mode: What actions mean.
      spec: What the episode that begins next shall be.
      start: How this episode started; None before the first.
      random: The environment's random state, for wrappers of dm_control: what they draw, no episode draws.
      success_now: Whether the goals were met after the last control step.
      success_once: Whether they were after any of this episode.
      max_penetration: Deepest contact of this episode [m].
    """

    def __init__(self, config: TaskConfig, env_config: EnvConfig) -> None:
        """An empty table."""
        self.config = config
        self.env_config = env_config
        self.scene = Scene(env_config.robot_visuals)
        self.robot = self.scene.robot
        self.control_mode = actions.control_mode(env_config.control_mode)
        self.spec = EpisodeSpec()
        self.start: EpisodeStart | None = None
        self.control_timestep = CONTROL_TIMESTEP
        self.success_now = self.success_once = False
        self.max_penetration = 0.0
        self._task_observables: OrderedDict[str, observable.Observable] = OrderedDict()
        self._sensors: SensorObservables | None = None
        self._reader: SceneReader | None = None
        self._state: SceneState  # after the last control step
        self._action_shape = self.control_mode.spec().shape
        self._physics: mjcf.Physics | None = None
        self.random: np.random.RandomState | None = None
        self._randomiser: Randomiser | None = None
        self._delay = Delay()
        self._target = np.zeros(8)

    # What a subclass says.

    @abc.abstractmethod
    def sample(
        self, rng: np.random.RandomState, spec: EpisodeSpec, preview: Preview
    ) -> EpisodeStart:
        """Draw a start; everything random about it comes from `rng`.

        Args:
          rng: The environment's one generator.
          spec: What is asked of the episode.
          preview: Tells where things would be, for starts that depend on it.

        Raises:
          InputError: What `spec` asks for cannot be.
        """

    @property
    def observed_objects(self) -> tuple[str, ...]:
        """Every name that a rigid object in play has in any episode; observations are named for them."""
        return ("object",) if self.scene.rigid_objects else ()

    @property
    def observed_goals(self) -> tuple[str, ...]:
        """The observed goal poses of any episode: `goal` where there is one at most, else `goal_` and
        the object's name of each."""
        return ()

    @property
    def observed_furniture(self) -> tuple[ArticulatedObject, ...]:
        """The furniture of which every drawer and door is observed, by its name."""
        return self.scene.articulated_objects

    @property
    def extra_frames(self) -> Mapping[str, BodyFrame]:
        """More frames to observe, such as those of the part in question; of one set of names."""
        return {}

    @property
    def extra_observables(self) -> Mapping[str, observable.Observable]:
        """More for the mode `pose`; the poses of objects, furniture and goals are there anyway."""
        return {}

    # What this episode is about.

    @property
    def goals(self) -> tuple[Goal, ...]:
        """What this episode wants, all of it; for a planner too."""
        return () if self.start is None else self.start.goals

    @property
    def objects(self) -> dict[str, RigidObject]:
        """The rigid objects in play, by the names that goals use."""
        if self.start is None:
            return {}
        entities = self.scene.rigid_objects
        return {name: entities[placed.index] for name, placed in self.start.objects.items()}

    @property
    def object(self) -> RigidObject:
        """The rigid object that this episode is about: the first in play.

        Raises:
          InputError: There is none in play, as where furniture is opened or closed, or before the first episode.
        """
        for entity in self.objects.values():
            return entity
        instead = "reset it first" if self.start is None else "it has `articulated_objects` alone"
        raise InputError(f"task {self.env_config.task}: no rigid object is in play; {instead}")

    @property
    def articulated_objects(self) -> tuple[ArticulatedObject, ...]:
        """The articulated objects in play; no two have parts of one name."""
        if self.start is None:
            return ()
        return tuple(self.scene.articulated_objects[p.index] for p in self.start.furniture)

    @property
    def furniture_masks(self) -> tuple[tuple[str, int], ...]:
        """Category of each piece of furniture in play, and its id in segmentations."""
        masks = self.scene.masks
        return tuple((piece.asset.category, masks[piece]) for piece in self.articulated_objects)

    @property
    def surroundings_masks(self) -> tuple[int, ...]:
        """Ids in segmentations of what stands around objects and furniture: all else, and fixtures such as a shelf."""
        masks = self.scene.masks
        fixtures = self.scene.fixtures.values()
        return (0, *(masks[each] for each in fixtures if each in masks))

    @property
    def object_name(self) -> str:
        """The asset that this episode is about."""
        return next(e.asset.name for e in (*self.objects.values(), *self.articulated_objects))

    @property
    def target(self) -> Float[np.ndarray, "8"]:
        """Where the control mode sends the servos now, joint angles [rad] and opening [m]: before latency and limits."""
        return self._target.copy()

    @property
    def noise_seed(self) -> int | None:
        """Of the sensors, in this episode; None before the first."""
        return None if self.start is None else self.start.noise_seed

    # Drawing and writing of starts

    def draw(self, rng: np.random.RandomState, spec: EpisodeSpec | None = None) -> EpisodeStart:
        """Draw how an episode starts; the simulation at hand is neither read nor changed.

        The same generator, in the same state, and the same `spec` give the same start.

        Args:
          rng: Draws.
          spec: What is asked of the episode; its seed has to be in `rng` already.

        Raises:
          InputError: What `spec` asks for cannot be.
          RuntimeError: The task was not compiled yet: no environment runs it.
        """
        if self._physics is None:
            raise RuntimeError("the task is in no environment yet: its scene was not compiled")
        assert self._randomiser is not None and self._preview is not None
        spec = spec or EpisodeSpec()
        self._check_asked(spec)
        changes = self._randomiser.draw(rng)
        changes = replace(changes, latency=changes.latency + self.env_config.latency)
        self._preview.change(changes)
        start = self.sample(rng, spec, self._preview)
        check_start(
            start,
            len(self.scene.rigid_objects),
            [[part.name for part in e.asset.parts] for e in self.scene.articulated_objects],
            self.scene.fixtures,
            self.observed_objects,
        )
        if spec.goal is not None:
            asked = [
                name
                for name, placed in start.objects.items()
                if self.scene.rigid_objects[placed.index].asset.name == spec.object
            ]
            start = with_goal(start, np.array(spec.goal), asked)
        # The seed is drawn whatever the sensors: the next episode shall not depend on what is observed.
        seed = int(rng.randint(2**31))
        return replace(read_only(start), model=changes, noise_seed=seed)

    def _check_asked(self, spec: EpisodeSpec) -> None:
        """Raise `InputError` where an episode is asked to be about what this task does not have."""
        scene = self.scene
        for field, kind, there in (
            ("object", "rigid object", scene.rigid_objects),
            ("furniture", "furniture", scene.articulated_objects),
            ("part", "furniture", scene.articulated_objects),
        ):
            name = getattr(spec, field)
            if name is not None and not there:
                raise InputError(f"{field} is {name!r}; this task has no {kind}: leave it out")

    def write(self, physics: mjcf.Physics, start: EpisodeStart) -> None:
        """Put a simulation where an episode starts, the robot at home, and let things come to rest."""
        self.start = start
        if start.model.fields:
            write_changes(physics, start.model)
        self.robot.set_configuration(physics, HOME, MAX_OPENING)
        steps = round(start.model.latency / self.physics_timestep)
        self._delay.start(steps, np.append(HOME, MAX_OPENING))
        with sleep_disabled(physics):
            self.scene.write(physics, start)
            # dm_control's step begins with the second half of the last one.
            physics.forward()
        physics.step(round(self.config.settle / self.physics_timestep))
        physics.data.time = 0.0

    # Success

    def scene_state(self, physics: mjcf.Physics) -> SceneState:
        """The state that goals and rewards are functions of."""
        if self._reader is None or not self._reader.reads(physics):
            scene = self.scene
            self._reader = SceneReader(
                physics, self.robot, scene.rigid_objects, scene.articulated_objects
            )
        return self._reader.read(physics, self.objects, self.articulated_objects)

    def succeeded(self, physics: mjcf.Physics) -> bool:
        """Whether all goals are met now."""
        return bool(success(self.goals, self.scene_state(physics), self.config.tolerance))

    def goal_error(self, physics: mjcf.Physics) -> tuple[float, float] | None:
        """The largest translation [m] and rotation [rad] error to a goal pose; None without one."""
        errors = [
            pose_error(
                self.objects[goal.object].label_pose(physics),
                goal.pose,
                self.objects[goal.object].asset.label.symmetry,
            )
            for goal in self.goals
            if isinstance(goal, PoseGoal)
        ]
        if not errors:
            return None
        return float(max(e[0] for e in errors)), float(max(e[1] for e in errors))

    # Sensors

    def add_sensors(self) -> None:
        """Add cameras and observables to the complete scene; `TaskEnvironment` does it, once."""
        slots = Slots(self.observed_objects, self.observed_goals, self.observed_furniture)
        self._sensors = SensorObservables(
            self,
            slots,
            self.scene.instances,
            self.scene.arena,
            self.env_config.sensors,
            self.env_config.obs_mode,
        )
        self._task_observables = self._sensors.build(self.extra_observables)

    @property
    def sensors(self) -> SensorObservables:
        """Cameras, images and clouds."""
        assert self._sensors is not None, "the task is in no environment yet"
        return self._sensors

    def close(self) -> None:
        """Free what the sensors hold."""
        self.sensors.close()

    def forget_images(self) -> None:
        """Drop what was rendered: the state has been changed from outside."""
        self.sensors.forget()

    # composer.Task

    @property
    def root_entity(self) -> composer.Entity:
        return self.scene.arena

    @property
    def task_observables(self) -> OrderedDict[str, observable.Observable]:
        return self._task_observables

    @property
    def instance_names(self) -> tuple[str, ...]:
        """What the ids of a segmentation stand for; 0 is everything else."""
        return ("background", *self.scene.instances)

    def action_spec(self, physics: mjcf.Physics) -> specs.BoundedArray:
        return self.control_mode.spec()

    def after_compile(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        self._physics, self.random = physics, random_state
        # Now, for episodes change the model.
        self._randomiser = self._make_randomiser(physics)
        self._preview = Preview(physics, self.scene)

    def initialize_episode(
        self, physics: mjcf.Physics, random_state: np.random.RandomState
    ) -> None:
        self.forget_images()
        self.write(physics, self.draw(random_state, self.spec))
        self.control_mode.reset(physics, self.robot)
        self._action_shape = self.control_mode.spec().shape  # the mode may have been changed
        self.success_now = self.success_once = False
        self.max_penetration = 0.0
        self._state = self.scene_state(physics)
        self.forget_images()

    def before_step(
        self,
        physics: mjcf.Physics,
        action: Float[np.ndarray, "n"] | None,
        random_state: np.random.RandomState,
    ) -> None:
        """Take the action of this control step; None: the servos go on as the last action said."""
        if action is None:
            return
        mode = self.control_mode
        mode.begin(
            physics, self.robot, actions.checked_action(mode.name, self._action_shape, action)
        )

    def before_substep(
        self,
        physics: mjcf.Physics,
        action: Float[np.ndarray, "n"] | None,
        random_state: np.random.RandomState,
    ) -> None:
        target = self._target
        target[:7], target[7] = self.control_mode.targets()
        self.robot.follow_targets(physics, self._delay.through(target))

    def after_substep(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        data = physics.data.ptr
        if data.ncon:  # none are computed between things asleep
            self.max_penetration = max(self.max_penetration, -float(data.contact.dist.min()))

    def after_step(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        self._state = self.scene_state(physics)
        self.success_now = bool(success(self.goals, self._state, self.config.tolerance))
        self.success_once = self.success_once or self.success_now

    def get_reward(self, physics: mjcf.Physics) -> float:
        if self.env_config.reward_mode == "sparse" or self.success_now:
            return float(self.success_now)
        return self.reward_of(self._state, self.goals)

    def reward_of(self, state: SceneState, goals: tuple[Goal, ...]) -> float:
        """The reward, of this task's kind, of a state of its scene against any goals."""
        return float(reward(goals, state, self.config.tolerance, self.env_config.reward_mode))

    def _make_randomiser(self, physics: mjcf.Physics) -> Randomiser:
        pads = np.asarray(physics.bind(self.robot.pad_geoms).element_id).tolist()
        strength = randomisation(self.env_config.randomisation)
        return Randomiser(strength, physics, self.scene.rigid_objects, pads)
