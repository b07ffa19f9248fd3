"""Paths of joints that bring the TCP to a pose, with what it holds; for poses that come from anywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.grasping.part_pick import way_in_hand
from manipose_mj.control.grasping.retreat import retreat
from manipose_mj.control.motion.batch_ik import seeds_for, solve
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.articulation import joint_motion
from manipose_mj.control.scene.collision_query import CONTACT, GRAZING, TRANSIT, CollisionQuery
from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.mjcf.panda.robot import MAX_OPENING
from manipose_mj.poses import invert, rotation_angle

_STANDOFFS = (0.10, 0.06, 0.03)  # before a pose that has no room around it, best first [m]
_SHORT = 0.12  # motions that are tried as a straight line first [m]
_LEVER = 0.2  # metres that a radian counts, to compare poses
_CONFIGURATIONS = 4  # of the arm, tried for one pose
# The open fingers pass closely by what they are about to take.
_APPROACH = replace(CONTACT, arm=0.002, target=0.0)

Path = Float[np.ndarray, "t 7"]


class TcpPaths:
    """Answers with joint paths to follow one after the other, or None if none was found."""

    def __init__(self, planner: MotionPlanner, estimate: SceneEstimate) -> None:
        """Plans with `planner`, in the scene of `estimate`."""
        self._planner = planner.within(estimate.scene)
        self._estimate = estimate

    def to_pose(self, pose: Float[np.ndarray, "4 4"], held: str | None) -> list[Path] | None:
        """To a pose of the TCP, free of collision; a held part goes along its joint only.

        Args:
          pose: `T_world_tcp`.
          held: Name of the object or part in the hand.
        """
        estimate = self._estimate
        if held in estimate.parts:
            path = self._part_path(estimate.parts[held], pose)
            return None if path is None else [path]
        free = CollisionQuery() if held is None else estimate.in_hand(held).query()
        here = estimate.tcp_pose
        if float(np.linalg.norm(pose[:3, 3] - here[:3, 3])) < _SHORT:
            line = self._planner.line(estimate.joints, pose, free.keeping(CONTACT))
            if line is not None:
                return [line]
        retraction = self._retraction(free)
        start = estimate.joints if retraction is None else retraction[-1]
        for joints in _configurations(pose, start):
            rest = self._arriving(start, joints, free)
            if rest is not None:
                return rest if retraction is None else [retraction, *rest]
        return None

    def _retraction(self, query: CollisionQuery) -> Path | None:
        """A way up, where what is held stands on something."""
        joints = self._estimate.joints
        if not self._planner.collides(joints, query.keeping(GRAZING)):
            return None
        for height in _STANDOFFS:
            above = _shifted(self._estimate.tcp_pose, np.array([0.0, 0.0, height]))
            retraction = self._planner.line(joints, above, query.keeping(CONTACT))
            if retraction is not None:
                return retraction
        return None

    def _arriving(
        self, start: Float[np.ndarray, "7"], goal: Float[np.ndarray, "7"], query: CollisionQuery
    ) -> list[Path] | None:
        """A free path to a configuration, by way of a place with more room where it has none."""
        if not self._planner.collides(goal, query.keeping(TRANSIT)):
            path = self._planner.free_path(start, goal, query)
            return None if path is None else [path]
        touching = query.keeping(CONTACT)
        if self._planner.collides(goal, touching):
            return None
        pose = self._planner.tcp_pose(goal)
        for direction in (np.array([0.0, 0.0, 1.0]), -pose[:3, 2]):
            for distance in _STANDOFFS:
                away = self._planner.line(goal, _shifted(pose, distance * direction), touching)
                if away is None:
                    continue
                path = self._planner.free_path(start, away[-1], query)
                if path is not None:
                    return [path, np.concatenate([away[::-1], goal[None]])]
        return None

    def approach(self, pose: Float[np.ndarray, "4 4"]) -> list[Path] | None:
        """A free path to a standoff and a straight way from there to the pose."""
        near, wide = self._estimate.joints, CollisionQuery(opening=MAX_OPENING)
        query = replace(wide, clearance=_APPROACH, target=self._objects())
        for joints in _configurations(pose, near):
            if self._planner.collides(joints, query):
                continue
            for standoff in _STANDOFFS:
                goal = self._planner.backed_off(joints, standoff)
                back = self._planner.line(joints, goal, query, touched=self._parts())
                if back is None:
                    continue
                path = self._planner.free_path(near, back[-1], wide)
                if path is not None:
                    return [path, np.concatenate([back[::-1], joints[None]])]
        return None

    def retreat(self) -> Path | None:
        """Straight back, to where the next motion has room if there is such a place."""
        return retreat(self._planner, self._estimate, self._objects(), self._parts())

    def _part_path(self, part: PartEstimate, pose: Float[np.ndarray, "4 4"]) -> Path | None:
        """To where the part's joint lets the TCP come nearest to the pose."""
        handle_tcp = invert(part.handle_pose) @ self._estimate.tcp_pose
        openings = np.linspace(*part.joint.range, 101)
        ways = [
            part.base_pose @ joint_motion(part, q) @ part.handle.pose @ handle_tcp for q in openings
        ]
        off = [
            float(np.linalg.norm(way[:3, 3] - pose[:3, 3]))
            + _LEVER * float(rotation_angle(way[:3, :3], pose[:3, :3]))
            for way in ways
        ]
        opening = float(openings[np.argmin(off)])
        way = way_in_hand(self._planner, self._estimate, part, opening)
        if way is None or abs(way.openings[-1] - opening) > 1e-6:
            return None
        return way.targets(self._planner.timestep)

    def _objects(self) -> Bool[np.ndarray, "ngeom"]:
        """Mask of the geoms of all objects and parts."""
        mask = np.zeros(self._planner.scene.model.ngeom, bool)
        for each in [*self._estimate.objects.values(), *self._estimate.parts.values()]:
            mask |= each.geoms
        return mask

    def _parts(self) -> frozenset[str]:
        """Names of the bodies of all parts."""
        return frozenset(self._planner.body_name(p.body) for p in self._estimate.parts.values())


def _configurations(
    pose: Float[np.ndarray, "4 4"], near: Float[np.ndarray, "7"]
) -> list[Float[np.ndarray, "7"]]:
    """Ways for the arm to take a pose, the nearest first [rad]."""
    seeds = np.concatenate([seeds_for(pose[None]), near[None, None]])
    joints, solved = solve(pose[None], seeds)
    found: list[Float[np.ndarray, "7"]] = []
    reaching = joints[solved]
    for k in np.argsort(np.abs(reaching - near).sum(axis=1), kind="stable"):
        if all(np.abs(reaching[k] - other).max() > 0.1 for other in found):
            found.append(reaching[k])
    return found[:_CONFIGURATIONS]


def _shifted(
    pose: Float[np.ndarray, "4 4"], offset: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "4 4"]:
    """The pose moved by an offset in the world [m]."""
    shifted = pose.copy()
    shifted[:3, 3] += offset
    return shifted
