"""Motions of one arm in one scene: free paths and straight lines, with what the hand holds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.motion.free_motion import FreeMotionConfig, plan_path
from manipose_mj.control.motion.line_motion import LineConfig, line_poses, track
from manipose_mj.control.motion.trajectory import Timing, timed, tracked
from manipose_mj.control.scene.collision_query import (
    GRAZING,
    ROUNDED,
    TRANSIT,
    CollisionQuery,
)
from manipose_mj.control.scene.planning_scene import PlanningScene

# Of every so many control steps one is checked for collision.
_CHECK_EVERY = 4
_CHECK_RESOLUTION = 0.02  # of free paths, in any joint [rad]
# From its support on which an attached object must be free [m].
_SUPPORT_DISTANCE = 0.02
# On a way, and once its corners are rounded; the widest that both ends allow.
_CLEARANCES = ((TRANSIT, ROUNDED), (ROUNDED, GRAZING), (GRAZING, GRAZING))
_EXCUSED = 0.001  # how much deeper a robot may be than at the start, in what it starts in [m]
_SPEED_SHARES = (1.0, 0.5, 0.25)
_PATIENT = FreeMotionConfig(max_nodes=8000)
_TIMING = Timing()
_LINE = LineConfig()
# Near a stretched arm the joints must turn fast for the hand to move slowly.
_SLOW_LINE = replace(_LINE, speed=0.05, turn_speed=0.3)


@dataclass(frozen=True)
class MotionPlanner:
    """Plans in one scene; where something is elsewhere, another planner plans.

    Attributes:
      scene: What a motion may hit.
      arm: The arm among it, for straight lines.
      timestep: Of control [s].
      rng: Of samples for free paths.
      contact_allowance: How far loose objects may be pushed aside where a motion ends in contact [m].
      support_allowance: How much nearer the gripper may come to what is fixed there [m].
    """

    scene: PlanningScene
    arm: ArmModel
    timestep: float
    rng: np.random.Generator
    contact_allowance: float = 0.0
    support_allowance: float = 0.0

    def within(self, scene: PlanningScene) -> MotionPlanner:
        """The same planner in another scene."""
        return replace(self, scene=scene)

    def allowing(self, contact_allowance: float) -> MotionPlanner:
        """The same planner, where loose objects may be pushed aside so far [m]."""
        return replace(self, contact_allowance=contact_allowance)

    def touching_support(self, support_allowance: float) -> MotionPlanner:
        """The same planner, where the gripper may come so much nearer to what is fixed [m]."""
        return replace(self, support_allowance=support_allowance)

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

    def raised(self, joints: Float[np.ndarray, "7"], distance: float) -> Float[np.ndarray, "4 4"]:
        """The TCP's pose after going straight up [m]."""
        pose = self.tcp_pose(joints)
        pose[2, 3] += distance
        return pose

    def body_name(self, body: int) -> str:
        """The name of a body of the scene."""
        return self.scene.model.body(body).name

    def collides(self, joints: Float[np.ndarray, "7"], query: CollisionQuery) -> bool:
        """Whether the arm, with what is attached, is too close to anything."""
        return self.scene.in_collision(joints, self._allowing(query))

    def excusing(self, joints: Float[np.ndarray, "7"], query: CollisionQuery) -> CollisionQuery:
        """The same question for a motion that starts in a configuration [rad] in which the robot is, collision or not.

        It may be as deep in anything as it is there, so that it can get out.
        """
        depths = self.scene.depths(joints, self._allowing(query))
        return replace(query, depths=np.where(depths > 0, depths + _EXCUSED, 0.0))

    def ignored(self, query: CollisionQuery) -> frozenset[str]:
        """Names of the bodies that the way of a straight line does not keep away from, for it is checked afterwards.

        None, but where a question excuses the robot for being in something: there nothing could be kept away from.
        """
        if query.depths is None or not query.depths.any():
            return frozenset()
        model = self.arm.model
        return frozenset(model.body(body).name for body in range(model.nbody))

    def obstacles(
        self, joints: Float[np.ndarray, "7"], query: CollisionQuery
    ) -> Bool[np.ndarray, "ngeom"]:
        """Mask of the geoms that the arm, with what is attached, is too close to."""
        return self.scene.obstacles(joints, self._allowing(query))

    def free_path(
        self,
        start: Float[np.ndarray, "7"],
        goal: Float[np.ndarray, "7"],
        query: CollisionQuery | None = None,
        *,
        tight: bool = False,
        near: bool = False,
        patient: bool = False,
    ) -> Float[np.ndarray, "t 7"] | None:
        """Joint targets from rest to rest through free space; None if no path was found.

        Keeps as far from everything as the start allows; out of what a scene has the robot in, it leads no deeper in.

        Args:
          start: A configuration [rad].
          goal: Another; it must have room around it, unless it may be `tight`.
          query: What to assume; clearances are chosen here.
          tight: See `goal`.
          near: Pass all else as near as at rounded corners.
          patient: Look for it long.
        """
        query = query or CollisionQuery()
        if self.collides(goal, query.keeping(GRAZING if tight else TRANSIT)):
            return None
        if self._is_here(start) and self.collides(start, query.keeping(GRAZING)):
            query = self.excusing(start, query.keeping(GRAZING))
        for wide, close in _CLEARANCES[1:] if near else _CLEARANCES:
            widely = query.keeping(wide)
            if self.collides(start, widely) or (tight and self.collides(goal, widely)):
                continue
            collides = partial(self.scene.in_collision, query=self._allowing(widely))
            path = plan_path(start, goal, collides, self.rng, _PATIENT if patient else None)
            if path is None:
                return None
            # Rounded corners leave the path that was checked; slower motions leave it less.
            collides = partial(self.scene.in_collision, query=self._allowing(query.keeping(close)))
            for share in _SPEED_SHARES:
                targets = timed(path, self.timestep, replace(_TIMING, speed=share * _TIMING.speed))
                driven = _thinned(tracked(targets, self.timestep))
                if not any(collides(q) for q in driven):
                    return targets
        return None

    def line(
        self,
        joints: Float[np.ndarray, "7"],
        goal: Float[np.ndarray, "4 4"],
        query: CollisionQuery,
        *,
        touched: frozenset[str] = frozenset(),
        off_support: bool = True,
    ) -> Float[np.ndarray, "t 7"] | None:
        """Joint targets along a straight line of the TCP to `goal`; None if it is not free.

        Args:
          joints: Where the line starts [rad].
          goal: `T_world_tcp`.
          query: What to assume.
          touched: Names of bodies that the motion is meant to touch.
          off_support: Whether what is attached may touch its support at the start only.
        """
        start = self.tcp_pose(joints)
        self.arm.follow(self.scene, joints, query.opening)
        targets = None
        for config in (_LINE, _SLOW_LINE):
            poses = line_poses(start, goal, self.timestep, config)
            targets = track(
                self.arm, joints, poses, self.timestep, touched_bodies=touched, config=config
            )
            if targets is not None:
                break
        if targets is None:
            return None
        at_start = self._allowing(query)
        clearance = query.clearance
        raised = max(clearance.attached, ROUNDED.attached)
        later = at_start.keeping(replace(clearance, attached=raised)) if off_support else at_start
        for q in [*targets[_CHECK_EVERY::_CHECK_EVERY], targets[-1]]:
            gone = float(np.linalg.norm(self.tcp_pose(q)[:3, 3] - start[:3, 3]))
            if self.scene.in_collision(q, later if gone > _SUPPORT_DISTANCE else at_start):
                return None
        return targets

    def _is_here(self, joints: Float[np.ndarray, "7"]) -> bool:
        """Whether the arm was observed in this configuration [rad]."""
        addresses = self.scene.collision_model.arm_addresses
        return bool(np.abs(self.scene.positions.qpos[addresses] - joints).max() < 1e-6)

    def _allowing(self, query: CollisionQuery) -> CollisionQuery:
        return replace(
            query,
            contact_allowance=self.contact_allowance,
            support_allowance=self.support_allowance,
        )


def _thinned(path: Float[np.ndarray, "t 7"]) -> Float[np.ndarray, "k 7"]:
    """Configurations of a path, no joint of neighbours further apart than the path's own steps or
    than the resolution of collision checks [rad]."""
    travelled = np.concatenate([[0.0], np.abs(np.diff(path, axis=0)).max(axis=1).cumsum()])
    _, first = np.unique(np.floor(travelled / _CHECK_RESOLUTION), return_index=True)
    return path[first]
