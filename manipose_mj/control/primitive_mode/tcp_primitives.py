"""`move_to`, `grasp_at` and `release` with a pose of the TCP: planned first, then carried out."""

from __future__ import annotations

import enum
from collections.abc import Callable, Generator

import numpy as np
from jaxtyping import Float

from manipose_mj.control.execution.executor import Action, Executor
from manipose_mj.control.grasping.candidates import OPENING_MARGIN
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.primitive_mode.tcp_paths import Path, TcpPaths
from manipose_mj.control.scene.scene_estimate import SceneEstimate
from manipose_mj.mjcf.panda.robot import MAX_OPENING
from manipose_mj.poses import invert, rotation_angle

_THERE = (0.001, 0.01)  # from a pose on which the TCP counts as being at it already [m, rad]
_ARRIVED = (0.01, 0.1)  # from a pose to which the arm was sent, at most [m, rad]
_LOST = (0.04, 0.6)  # by which an object may move in the hand [m, rad]
_LOST_PART = (0.04, np.inf)  # the same for a handle, about whose bar the hand may turn
_SETTLE = 0.25  # after letting go [s]


class Status(enum.IntEnum):
    """What became of a primitive."""

    DONE = 0
    NO_PLAN = 1  # nothing has moved
    LOST = 2  # the gripper closed on nothing, or what it held slipped out
    STOPPED = 3  # something was in the way, or the episode ended


Outcome = Generator[Action, None, Status]


class TcpPrimitives:
    """Generators of actions that return a `Status`; one that cannot be planned yields none.

    Nothing is remembered from one to the next: what is held is what lies between the pads.
    """

    def __init__(
        self,
        executor: Executor,
        planner: MotionPlanner,
        between_pads: Callable[[SceneEstimate], str | None],
    ) -> None:
        """Takes who executes, who plans, and who knows the object between the pads."""
        self._executor = executor
        self._planner = planner
        self._between_pads = between_pads

    def move_to(self, pose: Float[np.ndarray, "4 4"]) -> Outcome:
        """Bring the TCP, with what is held, to `T_world_tcp`; a held part along its joint only."""
        estimate = self._executor.observe()
        held = self._between_pads(estimate)
        paths = self._paths(estimate).to_pose(pose, held)
        if paths is None:
            return Status.NO_PLAN
        before = None if held is None else _pose_in_hand(estimate, held)
        yield from self._along(paths)
        estimate = self._executor.observe()
        if held is not None and before is not None:
            limit = _LOST_PART if held in estimate.parts else _LOST
            lost = _apart(_pose_in_hand(estimate, held), before, limit)
            if lost or self._between_pads(estimate) != held:
                return Status.LOST
        return self._arrival(estimate, paths[-1])

    def grasp_at(self, pose: Float[np.ndarray, "4 4"]) -> Outcome:
        """Come along the hand's z to `T_world_tcp` with the gripper open, and close it."""
        estimate = self._executor.observe()
        full = self._between_pads(estimate) is not None
        paths = None if full else self._paths(estimate).approach(pose)
        if paths is None:
            return Status.NO_PLAN
        yield from self._executor.open_to(MAX_OPENING)
        yield from self._along(paths)
        arrival = self._arrival(self._executor.observe(), paths[-1])
        yield from self._executor.close()
        if self._between_pads(self._executor.observe()) is None:
            return Status.LOST
        return arrival

    def release(self, pose: Float[np.ndarray, "4 4"]) -> Outcome:
        """Bring the TCP to `T_world_tcp` where it is not there yet, let go and back off."""
        estimate = self._executor.observe()
        if _apart(estimate.tcp_pose, pose, _THERE):
            status = yield from self.move_to(pose)
            if status is not Status.DONE:
                return status
            estimate = self._executor.observe()
        yield from self._executor.open_to(min(estimate.opening + OPENING_MARGIN, MAX_OPENING))
        yield from self._executor.wait(_SETTLE)
        back = self._paths(self._executor.observe()).retreat()
        if back is None:
            return Status.STOPPED
        yield from self._executor.follow(back)
        return self._arrival(self._executor.observe(), back)

    def _along(self, paths: list[Path]) -> Generator[Action]:
        for path in paths:
            yield from self._executor.follow(path)

    def _arrival(self, estimate: SceneEstimate, path: Path) -> Status:
        there = estimate.scene.tcp_pose(path[-1])
        stopped = _apart(estimate.tcp_pose, there, _ARRIVED)
        return Status.STOPPED if stopped else Status.DONE

    def _paths(self, estimate: SceneEstimate) -> TcpPaths:
        return TcpPaths(self._planner, estimate)


def _pose_in_hand(estimate: SceneEstimate, name: str) -> Float[np.ndarray, "4 4"]:
    part = estimate.parts.get(name)
    pose = estimate.objects[name].pose if part is None else part.handle_pose
    return invert(estimate.tcp_pose) @ pose


def _apart(
    a: Float[np.ndarray, "4 4"], b: Float[np.ndarray, "4 4"], limit: tuple[float, float]
) -> bool:
    """Whether two poses differ by more than a distance [m] or an angle [rad]."""
    distance = float(np.linalg.norm(a[:3, 3] - b[:3, 3]))
    return distance > limit[0] or float(rotation_angle(a[:3, :3], b[:3, :3])) > limit[1]
