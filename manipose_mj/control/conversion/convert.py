"""Translating a recorded episode from one control mode into another.

The way of ManiSkill's `replay_trajectory`: both modes command the same servos, so each step of the
translation is the action that sends them where the recording sent them, chosen from where the new
episode really is. Where an action cannot go as far as the recording's, all of the motion slows down;
and what is held lies in the hand a little differently when it moves differently, so the hand makes up
for that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dm_control import mjcf
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from manipose_mj.actions import ControlMode, TcpSolver, action_towards, control_mode
from manipose_mj.actions.tcp_motion import TcpPositionDelta, TcpTargetPositionDelta
from manipose_mj.control.conversion.recording import Recording, acting, task_of
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, invert, rotation_angle
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.core.task import ManipulationTask

# One step of the recording is this many parts; a step of the translation makes one to all of them.
_PARTS = 10
# Of the hand during a recording, for a mode that keeps its orientation [rad].
_MAX_TURN = 0.1
# Slips in the hand that count as none, and as an object lost for good [m, rad].
_NO_SLIP = (2e-4, 2e-3)
_TOO_FAR = (0.05, 0.5)
# How much of a correction is left a step after the object was let go.
_FADING = 0.98


@dataclass(frozen=True)
class _Trace:
    """What a recording did.

    Attributes:
      targets: Joint targets [rad] and opening [m] at the start, then at the end of every step.
      in_hand: At the same times the name of the held object with its `T_tcp_object`; None without.
    """

    targets: Float[np.ndarray, "t 8"]
    in_hand: list[tuple[str, Float[np.ndarray, "4 4"]] | None]


def convert(environment: TaskEnvironment, recording: Recording, mode: str) -> Recording:
    """The same episode with the actions of another control mode.

    The joints go where they went. A mode that moves the TCP takes it where it went, with whatever
    elbow its own inverse kinematics choose.

    Args:
      environment: Of the task that was recorded.
      recording: Made in any mode.
      mode: Name of the mode to translate into.

    Raises:
      InputError: An unknown mode; or one that cannot turn the hand, and the recording does.
    """
    control_mode(mode)  # an unknown name fails before anything runs
    trace = _traced(environment, recording)
    correction = _Correction()
    taken, done = [], 0
    with acting(environment, mode, recording.seed) as mine:
        task, physics = task_of(environment), environment.physics
        if isinstance(mine.law, TcpPositionDelta | TcpTargetPositionDelta):
            _refuse_turns(mine, trace.targets)
        while done < _PARTS * len(recording.actions):
            correction.update(trace.in_hand[done // _PARTS], task, physics)
            for parts in range(_PARTS, 0, -1):
                target = correction.applied(_between(trace.targets, done + parts))
                action, arrives = action_towards(
                    mine, physics, task.robot, target[:7], target[7], task.control_timestep
                )
                if arrives:
                    break
            done += parts
            taken.append(action)
            if environment.step(action, observe=False).last():
                break
        return Recording(mode, recording.seed, np.array(taken), task.success_now)


class _Correction:
    """How the hand must differ from the recording's for what it holds to be where it was."""

    def __init__(self) -> None:
        self._solver = TcpSolver()
        self._offset = np.eye(4)  # T_recorded-tcp_tcp

    def update(
        self,
        recorded: tuple[str, Float[np.ndarray, "4 4"]] | None,
        task: ManipulationTask,
        physics: mjcf.Physics,
    ) -> None:
        """Compare what is in the hand with what the recording had there."""
        held = _in_hand(task, physics)
        if recorded is None or held is None or recorded[0] != held[0]:
            self._offset = _faded(self._offset)
            return
        offset = recorded[1] @ invert(held[1])
        if not _exceeds(offset, _TOO_FAR):
            self._offset = offset

    def applied(self, target: Float[np.ndarray, "8"]) -> Float[np.ndarray, "8"]:
        """The joint targets with the hand so displaced, the opening as it is."""
        if not _exceeds(self._offset, _NO_SLIP):
            return target
        joints, _ = self._solver.reach(self._solver.pose(target[:7]) @ self._offset, target[:7])
        return np.append(joints, target[7])


def _traced(environment: TaskEnvironment, recording: Recording) -> _Trace:
    with acting(environment, recording.mode, recording.seed):
        task, physics = task_of(environment), environment.physics
        servos = [*task.robot.actuators, task.robot.gripper_actuator]
        assert task.start is not None
        late = task.start.model.latency > 0  # what is converted will be as late again
        targets = [np.append(*task.robot.configuration(physics))]
        in_hand = [_in_hand(task, physics)]
        for action in recording.actions:
            environment.step(action, observe=False)
            targets.append(task.target if late else np.array(physics.bind(servos).ctrl))
            in_hand.append(_in_hand(task, physics))
    return _Trace(np.array(targets), in_hand)


def _in_hand(
    task: ManipulationTask, physics: mjcf.Physics
) -> tuple[str, Float[np.ndarray, "4 4"]] | None:
    """The object between the pads and its `T_tcp_object`."""
    state = task.scene_state(physics)
    for name, obj in state.objects.items():
        if obj.held:
            return name, invert(state.tcp_pose) @ obj.label_pose
    return None


def _refuse_turns(mode: ControlMode, targets: Float[np.ndarray, "t 8"]) -> None:
    """Raises an `InputError` where the hand turns, which such a mode cannot say."""
    solver = TcpSolver()
    rotations = np.stack([solver.pose(joints)[:3, :3] for joints in targets[:, :7]])
    turn = float(rotation_angle(rotations, rotations[0]).max())
    if turn > _MAX_TURN:
        raise InputError(
            f"the recording turns the hand by {np.degrees(turn):.0f} deg, which {mode.name} cannot; "
            "a mode that can is pd_ee_delta_pose"
        )


def _between(path: Float[np.ndarray, "t 8"], parts: int) -> Float[np.ndarray, "8"]:
    """Joint targets on the way between two of a path, and the opening of the first."""
    index, rest = divmod(min(parts, _PARTS * (len(path) - 1)), _PARTS)
    if not rest:
        return path[index]
    target = path[index].copy()
    target[:7] += rest / _PARTS * (path[index + 1, :7] - path[index, :7])
    return target


def _exceeds(offset: Float[np.ndarray, "4 4"], limit: tuple[float, float]) -> bool:
    """Whether an offset is longer than a distance [m] or turned further than an angle [rad]."""
    turn = float(rotation_angle(offset[:3, :3], np.eye(3)))
    return float(np.linalg.norm(offset[:3, 3])) > limit[0] or turn > limit[1]


def _faded(offset: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
    """A little less of an offset."""
    turn = Rotation.from_matrix(offset[:3, :3]).as_rotvec()
    return compose(Rotation.from_rotvec(_FADING * turn).as_matrix(), _FADING * offset[:3, 3])
