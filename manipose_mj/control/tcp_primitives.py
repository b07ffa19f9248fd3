"""`move_to`, `grasp_at` and `release` with a pose of the TCP: planned first, then carried out."""

from __future__ import annotations

import enum
from collections.abc import Callable, Generator

import numpy as np
from jaxtyping import Float

from manipose_mj.control.belief import Belief
from manipose_mj.control.executor import Action, Executor
from manipose_mj.control.grasp_candidates import OPENING_MARGIN
from manipose_mj.control.motion_planner import MotionPlanner
from manipose_mj.control.tcp_paths import Path, TcpPaths
from manipose_mj.mjcf.panda import MAX_OPENING
from manipose_mj.poses import invert, rotation_angle

_THERE = (0.001, 0.01)  # from a pose on which the TCP counts as being at it already [m, rad]
_ARRIVED = (0.01, 0.1)  # from a pose to which the arm was sent, at most [m, rad]
_LOST = (0.04, 0.6)  # by which a thing may move in the hand [m, rad]
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
        between_pads: Callable[[Belief], str | None],
    ) -> None:
        """Takes who executes, who plans, and who knows the thing between the pads."""
        self._executor = executor
        self._planner = planner
        self._paths = TcpPaths(planner, executor.timestep)
        self._between_pads = between_pads

    def move_to(self, pose: Float[np.ndarray, "4 4"]) -> Outcome:
        """Bring the TCP, with what is held, to `T_world_tcp`; a held part along its joint only."""
        belief = self._executor.perceive()
        held = self._between_pads(belief)
        paths = self._paths.to_pose(belief, pose, held)
        if paths is None:
            return Status.NO_PLAN
        before = None if held is None else self._pose_in_hand(belief, held)
        yield from self._along(paths)
        belief = self._executor.perceive()
        if held is not None and before is not None:
            limit = _LOST_PART if held in belief.parts else _LOST
            lost = _apart(self._pose_in_hand(belief, held), before, limit)
            if lost or self._between_pads(belief) != held:
                return Status.LOST
        return self._arrival(belief, paths[-1])

    def grasp_at(self, pose: Float[np.ndarray, "4 4"]) -> Outcome:
        """Come along the hand's z to `T_world_tcp` with the gripper open, and close it."""
        belief = self._executor.perceive()
        full = self._between_pads(belief) is not None
        paths = None if full else self._paths.approach(belief, pose)
        if paths is None:
            return Status.NO_PLAN
        yield from self._executor.open_to(MAX_OPENING)
        yield from self._along(paths)
        arrival = self._arrival(self._executor.perceive(), paths[-1])
        yield from self._executor.close()
        if self._between_pads(self._executor.perceive()) is None:
            return Status.LOST
        return arrival

    def release(self, pose: Float[np.ndarray, "4 4"]) -> Outcome:
        """Bring the TCP to `T_world_tcp` where it is not there yet, let go and back off."""
        belief = self._executor.perceive()
        if _apart(self._planner.tcp_pose(belief.joints), pose, _THERE):
            status = yield from self.move_to(pose)
            if status is not Status.DONE:
                return status
            belief = self._executor.perceive()
        yield from self._executor.open_to(min(belief.opening + OPENING_MARGIN, MAX_OPENING))
        yield from self._executor.wait(_SETTLE)
        back = self._paths.retreat(self._executor.perceive())
        if back is None:
            return Status.STOPPED
        yield from self._executor.follow(back)
        return self._arrival(self._executor.perceive(), back)

    def _along(self, paths: list[Path]) -> Generator[Action]:
        for path in paths:
            yield from self._executor.follow(path)

    def _arrival(self, belief: Belief, path: Path) -> Status:
        there = self._planner.tcp_pose(path[-1])
        stopped = _apart(self._planner.tcp_pose(belief.joints), there, _ARRIVED)
        return Status.STOPPED if stopped else Status.DONE

    def _pose_in_hand(self, belief: Belief, name: str) -> Float[np.ndarray, "4 4"]:
        part = belief.parts.get(name)
        pose = belief.objects[name].pose if part is None else part.handle_pose
        return invert(self._planner.tcp_pose(belief.joints)) @ pose


def _apart(
    a: Float[np.ndarray, "4 4"], b: Float[np.ndarray, "4 4"], limit: tuple[float, float]
) -> bool:
    """Whether two poses differ by more than a distance [m] or an angle [rad]."""
    distance = float(np.linalg.norm(a[:3, 3] - b[:3, 3]))
    return distance > limit[0] or float(rotation_angle(a[:3, :3], b[:3, :3])) > limit[1]
