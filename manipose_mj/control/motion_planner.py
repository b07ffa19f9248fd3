"""Motions of one arm in one scene: free paths and straight lines, with what the hand carries."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.arm_model import ArmModel
from manipose_mj.control.belief import ObjectBelief, PartBelief
from manipose_mj.control.free_motion import plan_path
from manipose_mj.control.line_motion import LineConfig, line_poses, track
from manipose_mj.control.planning_scene import (
    GRAZING,
    ROUNDED,
    TRANSIT,
    Carried,
    Clearance,
    PlanningScene,
    carried_free_body,
)
from manipose_mj.control.trajectory import Timing, timed, tracked
from manipose_mj.poses import compose, invert, pose_to_vector, rotation_about, vector_to_pose

# How far to back off after letting go, best first [m]; the last must do.
RETREATS = (0.12, 0.18, 0.09, 0.06)
HANDLE_RETREATS = (0.10, 0.07, 0.045)
# Of every so many control steps one is checked for collision.
_CHECK_EVERY = 4
_CHECK_RESOLUTION = 0.02  # of free paths, in any joint [rad]
# From its support on which a carried thing must be free [m].
_SUPPORT_DISTANCE = 0.02
_SPEED_SHARES = (1.0, 0.5, 0.25)


class MotionPlanner:
    """Plans on the planning scene and on the arm model, both of which follow the belief."""

    def __init__(
        self, scene: PlanningScene, arm: ArmModel, timestep: float, rng: np.random.Generator
    ) -> None:
        self.scene = scene
        self._arm = arm
        self._timestep = timestep
        self._rng = rng
        self._timing = Timing()
        self._line = LineConfig()
        # Near a stretched arm the joints must turn fast for the hand to move slowly.
        self._slow_line = replace(self._line, speed=0.05, turn_speed=0.3)

    def tcp_pose(self, joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "4 4"]:
        """`T_world_tcp`."""
        return self.scene.tcp_pose(joints)

    def backed_off(
        self, joints: Float[np.ndarray, "7"], distance: float
    ) -> Float[np.ndarray, "4 4"]:
        """The TCP's pose after going back along its approach [m]."""
        pose = self.tcp_pose(joints)
        pose[:3, 3] -= distance * pose[:3, 2]
        return pose

    def body_name(self, body: int) -> str:
        """The name of a body of the scene."""
        return self.scene.model.body(body).name

    def free_joint(self, thing: ObjectBelief) -> int:
        """The free joint that an object's body hangs on."""
        return int(self.scene.model.body_jntadr[thing.body])

    def held_at(self, thing: ObjectBelief, tcp_pose: Float[np.ndarray, "4 4"]) -> Carried:
        """The object, from where it is now, in a hand at `T_world_tcp`."""
        joint, pose_tcp = self.free_joint(thing), invert(tcp_pose) @ thing.pose
        return carried_free_body(self.scene.model, thing.body, joint, pose_tcp)

    def collides(
        self,
        joints: Float[np.ndarray, "7"],
        *,
        clearance: Clearance,
        target: Bool[np.ndarray, "ngeom"] | None = None,
        carried: Carried | None = None,
    ) -> bool:
        """Whether the arm, with what it carries, is too close to anything."""
        with self.scene.query(clearance=clearance, target=target, carried=carried) as scene:
            return scene.in_collision(joints)

    def free_path(
        self,
        start: Float[np.ndarray, "7"],
        goal: Float[np.ndarray, "7"],
        *,
        carried: Carried | None = None,
        tight: bool = False,
    ) -> Float[np.ndarray, "t 7"] | None:
        """Joint targets from rest to rest through free space; None if no path was found.

        Keeps as far from everything as the start allows; the goal must have room around it, unless it may
        be `tight`.
        """
        if self.collides(goal, clearance=GRAZING if tight else TRANSIT, carried=carried):
            return None
        for wide, close in ((TRANSIT, ROUNDED), (ROUNDED, GRAZING), (GRAZING, GRAZING)):
            if self.collides(start, clearance=wide, carried=carried):
                continue
            if tight and self.collides(goal, clearance=wide, carried=carried):
                continue
            with self.scene.query(clearance=wide, carried=carried) as scene:
                path = plan_path(start, goal, scene.in_collision, self._rng)
            if path is None:
                return None
            # Rounded corners leave the path that was checked; slower motions leave it less.
            with self.scene.query(clearance=close, carried=carried) as scene:
                for share in _SPEED_SHARES:
                    timing = replace(self._timing, speed=share * self._timing.speed)
                    targets = timed(path, self._timestep, timing)
                    driven = _thinned(tracked(targets, self._timestep))
                    if not any(scene.in_collision(q) for q in driven):
                        return targets
        return None

    def line(
        self,
        joints: Float[np.ndarray, "7"],
        goal: Float[np.ndarray, "4 4"],
        *,
        clearance: Clearance,
        target: Bool[np.ndarray, "ngeom"] | None = None,
        carried: Carried | None = None,
        touched: frozenset[str] = frozenset(),
        off_support: bool = True,
    ) -> Float[np.ndarray, "t 7"] | None:
        """Joint targets along a straight line of the TCP to `goal`; None if it is not free.

        What is carried may touch its support at the beginning only, if the line leads `off_support`.
        """
        start = self.tcp_pose(joints)
        self._arm.follow(self.scene)
        targets = None
        for config in (self._line, self._slow_line):
            poses = line_poses(start, goal, self._timestep, config)
            targets = track(
                self._arm, joints, poses, self._timestep, touched_bodies=touched, config=config
            )
            if targets is not None:
                break
        if targets is None:
            return None
        lifted = replace(clearance, carried=max(clearance.carried, ROUNDED.carried))
        for q in [*targets[_CHECK_EVERY::_CHECK_EVERY], targets[-1]]:
            gone = float(np.linalg.norm(self.tcp_pose(q)[:3, 3] - start[:3, 3]))
            allowed = lifted if off_support and gone > _SUPPORT_DISTANCE else clearance
            if self.collides(q, clearance=allowed, target=target, carried=carried):
                return None
        return targets

    @contextmanager
    def part_at(self, part: PartBelief, opening: float) -> Iterator[None]:
        """Ask with the part, and what is in it, at another opening [m or rad]."""
        qpos = self.scene.data.qpos
        saved = qpos.copy()
        qpos[self._joint_address(part.body)] = opening
        moved = joint_motion(part, opening) @ invert(joint_motion(part, part.opening))
        motion = part.base_pose @ moved @ invert(part.base_pose)
        for body in part.contents:
            address = self._joint_address(body)
            pose = vector_to_pose(saved[address : address + 7])
            qpos[address : address + 7] = pose_to_vector(motion @ pose)
        try:
            yield
        finally:
            qpos[:] = saved

    def _joint_address(self, body: int) -> int:
        """Where in `qpos` the joint of a body begins."""
        return int(self.scene.model.jnt_qposadr[self.scene.model.body_jntadr[body]])


def _thinned(path: Float[np.ndarray, "t 7"]) -> Float[np.ndarray, "k 7"]:
    """Configurations of a path, no joint of neighbours further apart than the path's own steps or
    than the resolution of collision checks [rad]."""
    travelled = np.concatenate([[0.0], np.abs(np.diff(path, axis=0)).max(axis=1).cumsum()])
    _, first = np.unique(np.floor(travelled / _CHECK_RESOLUTION), return_index=True)
    return path[first]


def joint_motion(part: PartBelief, position: float) -> Float[np.ndarray, "4 4"]:
    """How the part has moved, in the object frame, when its joint is at `position`."""
    joint = part.joint
    if joint.kind == "slide":
        return compose(np.eye(3), joint.axis * position)
    rotation = rotation_about(joint.axis, position)
    return compose(rotation, joint.origin - rotation @ joint.origin)
