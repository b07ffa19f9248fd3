"""Paths of joints that bring the TCP to a pose, with what it holds; for poses that come from anywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.batch_ik import seeds_for, solve
from manipose_mj.control.belief import Belief, PartBelief
from manipose_mj.control.motion_planner import RETREATS, MotionPlanner, joint_motion
from manipose_mj.control.part_pick import way_in_hand
from manipose_mj.control.planning_scene import CONTACT, GRAZING, TRANSIT, Carried
from manipose_mj.mjcf.panda import MAX_OPENING
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

    def __init__(self, planner: MotionPlanner, timestep: float) -> None:
        """Plans with `planner`; paths have a configuration for every control step of `timestep` [s]."""
        self._planner = planner
        self._timestep = timestep

    def to_pose(
        self, belief: Belief, pose: Float[np.ndarray, "4 4"], held: str | None
    ) -> list[Path] | None:
        """To a pose of the TCP, free of collision; a held part goes along its joint only.

        Args:
          belief: What is where.
          pose: `T_world_tcp`.
          held: Name of the object or part in the hand.
        """
        if held in belief.parts:
            path = self._part_path(belief, belief.parts[held], pose)
            return None if path is None else [path]
        carried = None if held is None else self._carried(belief, held)
        here = self._planner.tcp_pose(belief.joints)
        if float(np.linalg.norm(pose[:3, 3] - here[:3, 3])) < _SHORT:
            line = self._planner.line(belief.joints, pose, clearance=CONTACT, carried=carried)
            if line is not None:
                return [line]
        lift = self._lift(belief, carried)
        start = belief.joints if lift is None else lift[-1]
        for joints in _configurations(pose, start):
            rest = self._arriving(start, joints, carried)
            if rest is not None:
                return rest if lift is None else [lift, *rest]
        return None

    def _lift(self, belief: Belief, carried: Carried | None) -> Path | None:
        """A way up, where what is held stands on something."""
        if not self._planner.collides(belief.joints, clearance=GRAZING, carried=carried):
            return None
        for height in _STANDOFFS:
            above = _shifted(self._planner.tcp_pose(belief.joints), np.array([0.0, 0.0, height]))
            lift = self._planner.line(belief.joints, above, clearance=CONTACT, carried=carried)
            if lift is not None:
                return lift
        return None

    def _arriving(
        self,
        start: Float[np.ndarray, "7"],
        goal: Float[np.ndarray, "7"],
        carried: Carried | None,
    ) -> list[Path] | None:
        """A free path to a configuration, by way of a place with more room where it has none."""
        if not self._planner.collides(goal, clearance=TRANSIT, carried=carried):
            path = self._planner.free_path(start, goal, carried=carried)
            return None if path is None else [path]
        if self._planner.collides(goal, clearance=CONTACT, carried=carried):
            return None
        pose = self._planner.tcp_pose(goal)
        for direction in (np.array([0.0, 0.0, 1.0]), -pose[:3, 2]):
            for distance in _STANDOFFS:
                away = self._planner.line(
                    goal, _shifted(pose, distance * direction), clearance=CONTACT, carried=carried
                )
                if away is None:
                    continue
                path = self._planner.free_path(start, away[-1], carried=carried)
                if path is not None:
                    return [path, np.concatenate([away[::-1], goal[None]])]
        return None

    def approach(self, belief: Belief, pose: Float[np.ndarray, "4 4"]) -> list[Path] | None:
        """A free path to a standoff and a straight way from there to the pose."""
        things = self._things(belief)
        parts = frozenset(self._planner.body_name(part.body) for part in belief.parts.values())
        self._planner.scene.set_opening(MAX_OPENING)
        for joints in _configurations(pose, belief.joints):
            if self._planner.collides(joints, clearance=_APPROACH, target=things):
                continue
            for standoff in _STANDOFFS:
                back = self._planner.line(
                    joints,
                    self._planner.backed_off(joints, standoff),
                    clearance=_APPROACH,
                    target=things,
                    touched=parts,
                )
                if back is None:
                    continue
                path = self._planner.free_path(belief.joints, back[-1])
                if path is not None:
                    return [path, np.concatenate([back[::-1], joints[None]])]
        return None

    def retreat(self, belief: Belief) -> Path | None:
        """Straight back, to where the next motion has room if there is such a place."""
        parts = frozenset(self._planner.body_name(part.body) for part in belief.parts.values())
        clearance, found = replace(CONTACT, arm=0.0), None
        for distance in RETREATS:
            line = self._planner.line(
                belief.joints,
                self._planner.backed_off(belief.joints, distance),
                clearance=clearance,
                target=self._things(belief),
                touched=parts,
            )
            if line is not None and not self._planner.collides(line[-1], clearance=TRANSIT):
                return line
            found = line if found is None else found
        return found

    def _part_path(
        self, belief: Belief, part: PartBelief, pose: Float[np.ndarray, "4 4"]
    ) -> Path | None:
        """To where the part's joint lets the TCP come nearest to the pose."""
        handle_tcp = invert(part.handle_pose) @ self._planner.tcp_pose(belief.joints)
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
        way = way_in_hand(self._planner, belief, part, opening)
        if way is None or abs(way.openings[-1] - opening) > 1e-6:
            return None
        return way.targets(self._timestep)

    def _things(self, belief: Belief) -> Bool[np.ndarray, "ngeom"]:
        """The geoms of all objects and parts."""
        mask = np.zeros(self._planner.scene.model.ngeom, bool)
        for thing in [*belief.objects.values(), *belief.parts.values()]:
            mask |= thing.geoms
        return mask

    def _carried(self, belief: Belief, name: str) -> Carried:
        return self._planner.held_at(belief.objects[name], self._planner.tcp_pose(belief.joints))


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
