"""Motions of one arm in one scene: free paths, straight lines, setting down, moving a part."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.arm_model import ArmModel
from manipose_mj.control.belief import ObjectBelief, PartBelief
from manipose_mj.control.free_motion import plan_path
from manipose_mj.control.grasp_candidates import reachable
from manipose_mj.control.line_motion import LineConfig, line_poses, track
from manipose_mj.control.planning_scene import (
    CONTACT,
    GRAZING,
    ROUNDED,
    TRANSIT,
    Carried,
    Clearance,
    PlanningScene,
)
from manipose_mj.control.trajectory import Timing, timed, tracked
from manipose_mj.poses import (
    SymmetryGroup,
    compose,
    invert,
    pose_to_vector,
    rotation_about,
    vector_to_pose,
)

# Heights from which an object is lowered to its place, best first [m].
_DESCENTS = (0.10, 0.06, 0.03)
# The same under a roof; and how far from all else it is carried there [m].
LOW_LIFTS = (0.03, 0.018, 0.010)
_INSIDE = 0.003
# How far something is pulled from under a roof [m], if its approach was level enough [sine].
_PULLS = (0.16, 0.09)
_SIDEWAYS = 0.8
# How far to back off after letting go, best first [m]; the last must do.
RETREATS = (0.12, 0.18, 0.09, 0.06)
HANDLE_RETREATS = (0.10, 0.07, 0.045)
_MAX_PLACES = 8
# Of every so many control steps one is checked for collision.
_CHECK_EVERY = 4
_CHECK_RESOLUTION = 0.02  # of free paths, in any joint [rad]
# From its support on which a carried thing must be free [m].
_SUPPORT_DISTANCE = 0.02
_SPEED_SHARES = (1.0, 0.5, 0.25)


@dataclass(frozen=True)
class Place:
    """How to set an object down: `above` `(7,)`, where the descent starts, and the descent `(t, 7)`."""

    above: Float[np.ndarray, "7"]
    descent: Float[np.ndarray, "t 7"]


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

    def carrying_path(
        self, start: Float[np.ndarray, "7"], goal: Float[np.ndarray, "7"], carried: Carried
    ) -> Float[np.ndarray, "t 7"] | None:
        """As `free_path`; from under a roof, where there is little room, at first back as the hand came."""
        free = self.free_path(start, goal, carried=carried)
        if free is not None:
            return free
        for distance in _PULLS:
            back = self.backed_off(start, distance)
            pull = self.line(start, back, clearance=CONTACT, carried=carried)
            if pull is None:
                continue
            free = self.free_path(pull[-1], goal, carried=carried)
            if free is not None:
                return np.concatenate([pull, free])
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

    def place(
        self,
        pose_tcp: Float[np.ndarray, "4 4"],
        label_poses: tuple[Float[np.ndarray, "4 4"], ...],
        symmetry: SymmetryGroup,
        carried: Carried,
        near: Float[np.ndarray, "7"],
        way_out: Float[np.ndarray, "3"] | None = None,
    ) -> Place | None:
        """A way to lower what is held to one of `label_poses`, nearest to the configuration `near`.

        Args:
          pose_tcp: `T_tcp_label` of what is held.
          label_poses: `T_world_label`, any of them will do.
          symmetry: Turns that change nothing.
          carried: What is held, for collision checks.
          near: Preferred configuration there [rad].
          way_out: Where the place has a roof: the way it is reached by, outwards [m].
        """
        tcp_poses = equivalent_poses(label_poses, symmetry) @ invert(pose_tcp)
        extra = np.broadcast_to(near, (len(tcp_poses), 7))
        reach = reachable(tcp_poses, near, extra_seeds=extra)
        order = np.argsort(np.abs(reach.joints - near).sum(axis=1), kind="stable")
        for k in order[:_MAX_PLACES]:
            place = self._lowered(reach.joints[k], carried, way_out)
            if place is not None:
                return place
        return None

    def _lowered(
        self,
        joints: Float[np.ndarray, "7"],
        carried: Carried,
        way_out: Float[np.ndarray, "3"] | None,
    ) -> Place | None:
        if self.collides(joints, clearance=CONTACT, carried=carried):
            return None
        # What is let go stays behind: only the arm has to get away.
        back = self.backed_off(joints, RETREATS[-1])
        let_go = replace(CONTACT, target=-np.inf)
        with self.scene.query(clearance=CONTACT, carried=carried) as scene:
            scene.first_collision(joints)  # puts what is carried in its place
            if self.line(joints, back, clearance=let_go, target=carried.geoms) is None:
                return None
        for ascent in self.ascents(joints, carried, way_out):
            if not self.collides(ascent[-1], clearance=TRANSIT, carried=carried):
                return Place(ascent[-1], np.concatenate([ascent[::-1], joints[None]]))
        return None

    def ascents(
        self,
        joints: Float[np.ndarray, "7"],
        carried: Carried,
        way_out: Float[np.ndarray, "3"] | None = None,
    ) -> Iterator[Float[np.ndarray, "t 7"]]:
        """Ways to lift what is held off its support, the best first; backwards they set it down.

        Straight up; or, under a roof, up a little and back as the hand came, or along `way_out` [m].
        """
        if way_out is not None:
            ways = [(height, way_out) for height in LOW_LIFTS]
        else:
            back = -self.tcp_pose(joints)[:3, 2]
            ways = [(height, None) for height in _DESCENTS]
            if back[2] < _SIDEWAYS:
                ways += [(LOW_LIFTS[1], distance * back) for distance in _PULLS]
        for height, way in ways:
            ascent = self.lifted(joints, height, carried, way)
            if ascent is not None:
                yield ascent

    def lifted(
        self,
        joints: Float[np.ndarray, "7"],
        height: float,
        carried: Carried,
        way_out: Float[np.ndarray, "3"] | None = None,
    ) -> Float[np.ndarray, "t 7"] | None:
        """Joint targets that lift what is held off its support [m], and on along `way_out` [m]."""
        above = self.tcp_pose(joints)
        above[2, 3] += height
        ascent = self.line(joints, above, clearance=CONTACT, carried=carried)
        if ascent is None or way_out is None:
            return ascent
        above[:3, 3] += way_out
        clearance = replace(CONTACT, carried=_INSIDE)
        exit_ = self.line(
            ascent[-1], above, clearance=clearance, carried=carried, off_support=False
        )
        return None if exit_ is None else np.concatenate([ascent, exit_])

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

    def part_path(
        self, joints: Float[np.ndarray, "7"], part: PartBelief, opening: float
    ) -> Float[np.ndarray, "t 7"] | None:
        """Joint targets that carry a held handle to another opening; None if the arm cannot."""
        start = self.tcp_pose(joints)
        handle_tcp = invert(part.handle_pose) @ start
        travel = abs(opening - part.opening)
        radius = 1.0
        if part.joint.kind == "hinge":
            lever = part.handle.origin - part.joint.origin
            radius = float(np.linalg.norm(np.cross(part.joint.axis, lever)))
        ends = np.eye(4), np.eye(4)
        ends[1][0, 3] = travel * radius
        share = line_poses(*ends, self._timestep, self._line)[:, 0, 3] / max(travel * radius, 1e-9)
        openings = part.opening + share * (opening - part.opening)
        poses = np.stack(
            [
                part.base_pose @ joint_motion(part, q) @ part.handle.pose @ handle_tcp
                for q in openings
            ]
        )
        self._arm.follow(self.scene)
        touched = frozenset({self.body_name(part.body)})
        targets = track(
            self._arm, joints, poses, self._timestep, touched_bodies=touched, config=self._line
        )
        if targets is None:
            return None
        with self.scene.query(clearance=CONTACT, target=part.geoms) as scene:
            for q, value in list(zip(targets, openings, strict=False))[::_CHECK_EVERY]:
                with self.part_at(part, value):
                    if scene.in_collision(q):
                        return None
        return targets


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


def equivalent_poses(
    label_poses: tuple[Float[np.ndarray, "4 4"], ...], symmetry: SymmetryGroup
) -> Float[np.ndarray, "m 4 4"]:
    """Every label pose combined with every sampled member of the symmetry group."""
    turns = symmetry.sampled()
    turned = compose(turns, np.zeros((len(turns), 3)))
    return np.concatenate([pose @ turned for pose in label_poses])
