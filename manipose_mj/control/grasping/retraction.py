"""Lifting what is held off its support, transporting it, and setting it down."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from manipose_mj.control.grasping.candidates import reachable
from manipose_mj.control.grasping.retreat import RETREATS
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.collision_query import (
    CONTACT,
    TRANSIT,
    AttachedObject,
    CollisionQuery,
)
from manipose_mj.poses import SymmetryGroup, compose, invert

# Heights from which an object is lowered to its place, best first [m].
_DESCENTS = (0.10, 0.06, 0.03)
# The same under a roof; and how far from all else it is carried there [m].
_LOW_LIFTS = (0.03, 0.018, 0.010)
_INSIDE = 0.003
# How far something is pulled from under a roof [m], if its approach was level enough [sine].
_PULLS = (0.16, 0.09)
_SIDEWAYS = 0.8
_MAX_PLACES = 8
_MAX_OTHERS = 12  # destinations looked at beyond those of the nearest places
# How far what finds no place is lowered, best first [m].
_LOWERINGS = tuple(float(d) for d in np.arange(0.16, 0.005, -0.01))


@dataclass(frozen=True)
class Place:
    """How to set an object down: `above` `(7,)`, where the descent starts, and the descent `(t, 7)`."""

    above: Float[np.ndarray, "7"]
    descent: Float[np.ndarray, "t 7"]


def find_place(
    planner: MotionPlanner,
    pose_tcp: Float[np.ndarray, "4 4"],
    label_poses: tuple[Float[np.ndarray, "4 4"], ...],
    symmetry: SymmetryGroup,
    attached: AttachedObject,
    near: Float[np.ndarray, "7"],
    way_out: Float[np.ndarray, "3"] | None = None,
) -> Place | None:
    """A way to lower what is held to one of `label_poses`, nearest to the configuration `near`.

    Args:
      planner: Plans in the scene of the estimate.
      pose_tcp: `T_tcp_label` of what is held.
      label_poses: `T_world_label`, any of them will do.
      symmetry: Turns that change nothing.
      attached: What is held, for collision checks.
      near: Preferred configuration there [rad].
      way_out: Where the place has a roof: the way it is reached by, outwards [m].
    """
    tcp_poses = equivalent_poses(label_poses, symmetry) @ invert(pose_tcp)
    extra = np.broadcast_to(near, (len(tcp_poses), 7))
    reach = reachable(tcp_poses, near, extra_seeds=extra)
    order = np.argsort(np.abs(reach.joints - near).sum(axis=1), kind="stable")
    owner = reach.index // (len(tcp_poses) // len(label_poses))
    for k in [*order[:_MAX_PLACES], *_of_each_other(owner, order)]:
        place = _lowered(planner, reach.joints[k], attached, way_out)
        if place is not None:
            return place
    return None


def _of_each_other(owner: Int[np.ndarray, "k"], order: Int[np.ndarray, "k"]) -> list[int]:
    """The first in order of each destination that is not among the first few."""
    seen = {int(owner[k]) for k in order[:_MAX_PLACES]}
    found = []
    for k in order[_MAX_PLACES:]:
        if int(owner[k]) not in seen:
            seen.add(int(owner[k]))
            found.append(int(k))
    return found[:_MAX_OTHERS]


def _lowered(
    planner: MotionPlanner,
    joints: Float[np.ndarray, "7"],
    attached: AttachedObject,
    way_out: Float[np.ndarray, "3"] | None,
) -> Place | None:
    if planner.collides(joints, attached.query(CONTACT)):
        return None
    # What is let go stays behind: only the arm has to get away.
    left_behind = attached.pose(planner.tcp_pose(joints))
    after = planner.within(planner.scene.with_body_at(attached.body, left_behind))
    back = planner.backed_off(joints, RETREATS[-1])
    let_go = replace(CONTACT, target=-np.inf)
    query = CollisionQuery(let_go, opening=attached.opening, target=attached.geoms)
    if after.line(joints, back, query) is None:
        return None
    for retraction in retractions(planner, joints, attached, way_out):
        if not planner.collides(retraction[-1], attached.query(TRANSIT)):
            return Place(retraction[-1], np.concatenate([retraction[::-1], joints[None]]))
    return None


def retractions(
    planner: MotionPlanner,
    joints: Float[np.ndarray, "7"],
    attached: AttachedObject,
    way_out: Float[np.ndarray, "3"] | None = None,
) -> Iterator[Float[np.ndarray, "t 7"]]:
    """Ways to lift what is held off its support, the best first; backwards they set it down.

    Straight up; or, under a roof, up a little and back as the hand came, or along `way_out` [m].
    """
    if way_out is not None:
        ways = [(height, way_out) for height in _LOW_LIFTS]
    else:
        back = -planner.tcp_pose(joints)[:3, 2]
        ways = [(height, None) for height in _DESCENTS]
        if back[2] < _SIDEWAYS:
            ways += [(_LOW_LIFTS[1], distance * back) for distance in _PULLS]
    for height, way in ways:
        retraction = _retracted(planner, joints, height, attached, way)
        if retraction is not None:
            yield retraction


def _retracted(
    planner: MotionPlanner,
    joints: Float[np.ndarray, "7"],
    height: float,
    attached: AttachedObject,
    way_out: Float[np.ndarray, "3"] | None = None,
) -> Float[np.ndarray, "t 7"] | None:
    """Joint targets that lift what is held off its support [m], and on along `way_out` [m]."""
    above = planner.tcp_pose(joints)
    above[2, 3] += height
    retraction = planner.line(joints, above, attached.query(CONTACT))
    if retraction is None or way_out is None:
        return retraction
    above[:3, 3] += way_out
    clearance = replace(CONTACT, attached=_INSIDE)
    exit_ = planner.line(retraction[-1], above, attached.query(clearance), off_support=False)
    return None if exit_ is None else np.concatenate([retraction, exit_])


def lowering(
    planner: MotionPlanner, joints: Float[np.ndarray, "7"], attached: AttachedObject
) -> Float[np.ndarray, "t 7"] | None:
    """Joint targets straight down, as far as what is held meets nothing; None if that is nowhere."""
    for depth in _LOWERINGS:
        below = planner.tcp_pose(joints)
        below[2, 3] -= depth
        line = planner.line(joints, below, attached.query(CONTACT), off_support=False)
        if line is not None:
            return line
    return None


def transport_path(
    planner: MotionPlanner,
    start: Float[np.ndarray, "7"],
    goal: Float[np.ndarray, "7"],
    attached: AttachedObject,
    *,
    pressed: bool = False,
    patient: bool = False,
) -> Float[np.ndarray, "t 7"] | None:
    """Joint targets from rest to rest with what is held; None if no path was found.

    Through free space; from under a roof, where there is little room, at first back as the hand came; what is `pressed`
    for a path passes all else nearer in the end; who is `patient` looks for longer then.
    """
    free = planner.free_path(start, goal, attached.query())
    if free is not None:
        return free
    for distance in _PULLS:
        back = planner.backed_off(start, distance)
        pull = planner.line(start, back, attached.query(CONTACT))
        if pull is None:
            continue
        free = planner.free_path(pull[-1], goal, attached.query())
        if free is not None:
            return np.concatenate([pull, free])
    if pressed:
        free = planner.free_path(start, goal, attached.query(), near=True)
    if free is None and patient:
        free = planner.free_path(start, goal, attached.query(), patient=True)
    return free


def equivalent_poses(
    label_poses: tuple[Float[np.ndarray, "4 4"], ...], symmetry: SymmetryGroup
) -> Float[np.ndarray, "m 4 4"]:
    """Every label pose combined with every sampled member of the symmetry group."""
    turns = symmetry.sampled()
    turned = compose(turns, np.zeros((len(turns), 3)))
    return np.concatenate([pose @ turned for pose in label_poses])
