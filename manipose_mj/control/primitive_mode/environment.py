"""`primitive`: an action is a whole motion with a target pose, planned and carried out to its end."""

from __future__ import annotations

import copy
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import dm_env
import numpy as np
from dm_control import mjcf
from dm_env import specs
from jaxtyping import Float

from manipose_mj.actions.control_mode import in_words, real_array
from manipose_mj.control.execution.executor import Executor
from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.control.primitive_mode.tcp_primitives import Outcome, Status, TcpPrimitives
from manipose_mj.control.scene.scene_estimate import SceneEstimate
from manipose_mj.errors import InputError
from manipose_mj.poses import vector_to_pose
from manipose_mj.tasks.core import snapshot
from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.core.task import ManipulationTask

PRIMITIVES = ("move_to", "grasp_at", "release")
STATUS = "primitive/status"
_REACH = 1.3  # nothing of the arm gets further from its base along any axis [m]


@dataclass(frozen=True)
class PrimitiveConfig:
    """Attributes: max_primitives: after which an episode ends, carried out or not."""

    max_primitives: int = 30


@dataclass(frozen=True)
class PrimitiveSnapshot:
    """Attributes: environment: its snapshot; count: of primitives so far; last: what the last one gave."""

    environment: snapshot.Snapshot
    count: int
    last: dm_env.TimeStep


class PrimitiveEnvironment(dm_env.Environment):
    """A task whose actions are `move_to`, `grasp_at` and `release`.

    An action is eight numbers: which of `PRIMITIVES` (0, 1, 2; rounded), then `T_world_tcp` as x, y, z
    [m] and a quaternion wxyz of any length.

    - `move_to` brings the TCP there, free of collision, with what it holds; a held drawer or door
      goes as near to it as its joint allows.
    - `grasp_at` opens the gripper, comes along the hand's z to the pose, and closes.
    - `release` brings the TCP there where it is not there yet, opens, and backs off.

    One step is the whole motion, as many control steps of `pd_joint_pos` as that takes. The observation,
    reward and discount are those of the last; `primitive/status` tells how it went: 0 done, 1 no plan
    was found and nothing moved, 2 the gripper is empty though it should not be, 3 stopped short of the
    pose. The controller that plans knows where everything is and remembers nothing; what the policy sees is
    the task's. `save` and `restore` take the place of `manipose_mj.tasks.core.snapshot`'s.
    """

    def __init__(self, environment: TaskEnvironment, config: PrimitiveConfig | None = None) -> None:
        """Wraps an environment of one of this package's tasks, in `pd_joint_pos`.

        Raises:
          InputError: The environment is in another control mode.
        """
        task = environment.task
        assert isinstance(task, ManipulationTask)
        mode = task.control_mode.name
        if mode != "pd_joint_pos":
            raise InputError(f"primitive acts through pd_joint_pos; the environment is in {mode}")
        self._environment = environment
        self._config = config or PrimitiveConfig()
        self._controller: _Controller | None = None
        self._last: dm_env.TimeStep | None = None
        self._count = 0

    @property
    def environment(self) -> TaskEnvironment:
        """The environment that carries the motions out."""
        return self._environment

    @property
    def physics(self) -> Any:
        """The physics of the scene."""
        return self._environment.physics

    @property
    def random_state(self) -> np.random.RandomState:
        """The environment's one generator."""
        return self._environment.random_state

    @property
    def failure(self) -> str:
        """`"physics"` when the simulation of this episode diverged, else empty."""
        return getattr(self._environment, "failure", "")

    @property
    def task(self) -> ManipulationTask:
        """The task, with the scene of the present episode."""
        return self._environment.task

    def action_spec(self) -> specs.BoundedArray:
        """Which primitive, position, quaternion."""
        minimum = np.array([0.0] + [-_REACH] * 3 + [-1.0] * 4)
        maximum = np.array([len(PRIMITIVES) - 1.0] + [_REACH] * 3 + [1.0] * 4)
        return specs.BoundedArray((8,), np.float64, minimum, maximum, name="primitive")

    def observation_spec(self) -> Any:
        """The task's, and the status."""
        spec = OrderedDict(self._environment.observation_spec())
        spec[STATUS] = specs.BoundedArray((), np.int64, min(Status), max(Status), name=STATUS)
        return spec

    def reward_spec(self) -> Any:
        """The task's."""
        return self._environment.reward_spec()

    def discount_spec(self) -> Any:
        """The task's."""
        return self._environment.discount_spec()

    def reset(self, spec: EpisodeSpec | None = None) -> dm_env.TimeStep:
        """Start an episode; arguments as for `TaskEnvironment`."""
        self._last = None  # where this fails, the next step begins an episode
        first = self._environment.reset(spec)
        self._count = 0
        return self._told(first, Status.DONE)

    def step(self, action: Any) -> dm_env.TimeStep:
        """Plan one primitive and carry it out.

        Raises:
          InputError: The action is not eight finite numbers, or its quaternion is zero.
        """
        if self._last is None or self._last.last():
            return self.reset()
        kind, pose = _checked(action)
        if self._controller is None or not self._controller.fits(self.physics):
            self._controller = _Controller(self.task, self.physics)
        motion: Outcome = getattr(self._controller.primitives(), kind)(pose)
        self._count += 1
        timestep, status = self._last, None
        while status is None:
            try:
                timestep = self._environment.step(next(motion))
            except StopIteration as done:
                status = done.value
            else:
                if timestep.last():
                    status = Status.STOPPED
        if timestep.reward is None:  # nothing has moved yet
            timestep = timestep._replace(reward=self.task.get_reward(self.physics), discount=1.0)
        if not timestep.last():
            over = self._count >= self._config.max_primitives
            timestep = timestep._replace(
                step_type=dm_env.StepType.LAST if over else dm_env.StepType.MID
            )
        return self._told(timestep, status)

    def save(self) -> PrimitiveSnapshot:
        """The present, between two primitives.

        Raises:
          InputError: It has not been reset yet.
        """
        saved = snapshot.save(self._environment)
        assert self._last is not None
        return PrimitiveSnapshot(saved, self._count, copy.deepcopy(self._last))

    def restore(self, saved: PrimitiveSnapshot) -> Any:
        """Put an environment of the same task and options back; what follows is the same.

        Returns:
          The observation of that moment.

        Raises:
          InputError: As of `manipose_mj.tasks.core.snapshot.restore`.
        """
        snapshot.restore(self._environment, saved.environment)
        self._count, self._last = saved.count, copy.deepcopy(saved.last)
        return saved.last.observation

    def close(self) -> None:
        """Free what the environment holds."""
        self._environment.close()

    def __reduce__(self) -> tuple[Any, ...]:
        return PrimitiveEnvironment, (self._environment, self._config)

    def _told(self, timestep: dm_env.TimeStep, status: Status) -> dm_env.TimeStep:
        observation = OrderedDict(timestep.observation)
        observation[STATUS] = np.array(int(status), np.int64)
        self._last = timestep._replace(observation=observation)
        return self._last


class _Controller:
    """Plans and executes in one compiled scene, the same way whatever it did before."""

    def __init__(self, task: ManipulationTask, physics: mjcf.Physics) -> None:
        self._task, self._physics = task, physics
        self._model = physics.model.ptr
        self._arm = ArmModel(task.root_entity.mjcf_model, task.robot.mjcf_model.model)
        self._perception = OraclePerception(task, physics)

    def fits(self, physics: mjcf.Physics) -> bool:
        """Whether the scene is still the compiled one."""
        return physics.model.ptr is self._model

    def primitives(self) -> TcpPrimitives:
        """Primitives that go on from what the servos were sent last."""
        robot, timestep = self._task.robot, self._task.control_timestep
        servos = [*robot.actuators, robot.gripper_actuator]
        command = np.array(self._physics.bind(servos).ctrl)
        rng = np.random.default_rng(0)
        scene = self._perception.observe().scene
        planner = MotionPlanner(scene, self._arm, timestep, rng)
        executor = Executor(self._perception, timestep, command)
        return TcpPrimitives(executor, planner, self._between_pads)

    def _between_pads(self, estimate: SceneEstimate) -> str | None:
        """The object or part that both pads touch."""
        geoms = self._physics.data.contact.geom
        pairs = np.concatenate([geoms, geoms[:, ::-1]])
        left, right = self._physics.bind(self._task.robot.pad_geoms).element_id
        for objects in (estimate.objects, estimate.parts):
            for name, obj in objects.items():
                own = pairs[obj.geoms[pairs[:, 1]], 0]
                if (own == left).any() and (own == right).any():
                    return name
        return None


def _checked(action: Any) -> tuple[str, Float[np.ndarray, "4 4"]]:
    """The primitive's name and the pose.

    Raises:
      InputError: The action is something else than eight finite numbers, or has no rotation.
    """
    array = real_array(action)
    if array is None or array.shape != (8,) or not np.isfinite(array).all() or not array[4:].any():
        raise InputError(
            f"action {in_words(action)}; primitive expects 8 finite numbers: "
            "which primitive, x, y, z and a quaternion that is not zero"
        )
    index = round(float(np.clip(array[0], 0, len(PRIMITIVES) - 1)))
    return PRIMITIVES[index], vector_to_pose(array[1:])
