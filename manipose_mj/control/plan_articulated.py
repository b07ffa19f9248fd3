"""Plans around drawers and doors: open them, put things behind them, take things out, shut them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np
from jaxtyping import Float

from manipose_mj.control.belief import Belief, ObjectBelief, PartBelief
from manipose_mj.control.carrying import place
from manipose_mj.control.cavity_mouth import outwards
from manipose_mj.control.motion_planner import MotionPlanner, joint_motion
from manipose_mj.control.plan import Plan, Step
from manipose_mj.control.regrasp import Poses, routes
from manipose_mj.control.table_places import DROP_HEIGHT, YAWS, resting_height, resting_rotation
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, invert, rotation_about
from manipose_mj.tasks.goals import InsideGoal, OpenGoal, ShutGoal, TakenOutGoal

PartGoal = InsideGoal | TakenOutGoal | OpenGoal | ShutGoal

# How far to open, of the joint's range: all the way would ram the stop.
OPEN_SHARE = 0.95
OPEN_ENOUGH = 0.85
SHUT_ENOUGH = 0.005  # of a joint [m or rad]
CAVITY_MARGIN = np.array([0.010, 0.010, 0.004])  # in all, along each axis [m]
# Where in the cavity, as a share of the free way from its middle to its front: the hand that sets
# something down needs room in front of what is above, or beside, or both.
_DRAWER_FRONT = (0.35, 0.5, 0.2, 0.7, 0.95, 0.0, -0.3, -0.6)
_DOOR_FRONT = (0.95, 0.75, 0.5, 0.25)
_SIDEWAYS = (0.0, 0.3, -0.3, 0.6, -0.6, 0.95, -0.95)
_MAX_PER_WAY = 3  # places in the cavity for each way to lie
_APART = 0.008  # between things that lie side by side [m]
_SAME_SIDE = 0.95  # cosine from which on two verticals are one
_AREA_SHARES = ((0.0, 0.0), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5))
_UP = np.array([0.0, 0.0, 1.0])


def plan_part_goal(
    goal: PartGoal,
    belief: Belief,
    planner: MotionPlanner | None,
    skip: int,
    moved: set[str],
) -> Plan:
    """Steps towards one goal.

    Args:
      goal: What is wanted.
      belief: What is where.
      planner: Of motions in the scene of `belief`; without one nothing is set down on the way.
      skip: So many of the ways that come first; they turned out not to work.
      moved: Parts that the steps before have opened; added to.

    Raises:
      InputError: An object fits a cavity in no orientation.
    """
    part = belief.parts[goal.part]
    low, high = part.joint.range
    if isinstance(goal, ShutGoal):
        if goal.part in moved or part.opening > low + SHUT_ENOUGH:
            return (Step("move_to", goal.part, opening=low),)
        return ()
    if isinstance(goal, OpenGoal):
        share = max(OPEN_SHARE, min((1 + goal.fraction) / 2, 1.0))
        if part.opening >= low + goal.fraction * (high - low):
            return ()
        return _open(part, low + share * (high - low))
    thing = belief.objects[goal.object]
    opened = low + OPEN_SHARE * (high - low)
    plan: Plan = ()
    if isinstance(goal, InsideGoal):
        if lies_inside(thing, part):
            return ()
        poses = poses_in_cavity(thing, part, opened, belief)
        if not poses:
            raise InputError(f"{goal.object} fits the cavity of {goal.part} in no orientation")
    else:
        poses = poses_in_area(goal, thing, part)
        if not lies_inside(thing, part) and _near_one(thing, poses):
            return ()
    if part.opening < low + OPEN_ENOUGH * (high - low):
        plan = _open(part, opened)
    moved.add(goal.part)
    stops: tuple[Poses, ...] = (poses,)
    if planner is not None:
        with planner.part_at(part, max(opened, part.opening)):
            stops = list(islice(_ways(planner, belief, thing, part, poses), skip + 1))[-1]
    return plan + tuple(step for stop in stops for step in place(goal.object, stop))


def _ways(
    planner: MotionPlanner, belief: Belief, thing: ObjectBelief, part: PartBelief, poses: Poses
) -> Iterator[tuple[Poses, ...]]:
    """The direct way, and for what stands free on the table those with stops in between."""
    if lies_inside(thing, part):
        yield (poses,)
    else:
        yield from routes(planner, belief, thing, poses)


def _open(part: PartBelief, opening: float) -> Plan:
    """By the handle; a door that the hand cannot lead all the way is then pushed on from inside."""
    name = part.name
    plan: Plan = (
        Step("grasp_at", name),
        Step("move_to", name, opening=opening),
        Step("release", name),
    )
    return plan if part.joint.kind == "slide" else (*plan, Step("move_to", name, opening=opening))


def lies_inside(thing: ObjectBelief, part: PartBelief) -> bool:
    """Whether the object's middle is in the part's cavity."""
    if part.cavity is None:
        return False
    carrier = part.pose if part.cavity.moves_with_part else part.base_pose
    place_ = (invert(carrier) @ thing.label_pose)[:3, 3] - part.cavity.center
    return bool((np.abs(place_) < part.cavity.extents / 2).all())


def _near_one(thing: ObjectBelief, poses: Poses) -> bool:
    """Whether the object is at one of the places already, turned as it may be."""
    places = np.stack([pose[:3, 3] for pose in poses])
    return bool((np.linalg.norm(places - thing.label_pose[:3, 3], axis=1) < 0.05).any())


def poses_in_area(goal: TakenOutGoal, thing: ObjectBelief, part: PartBelief) -> Poses:
    """`T_world_label` in the goal area, resting on the side that is down now."""
    own = thing.label_pose[:3, :3]
    height = resting_height(thing, own) + DROP_HEIGHT
    turns = YAWS[:1] if thing.label.symmetry.axial and abs(own[2, 0]) > 0.99 else YAWS
    return tuple(
        compose(
            rotation_about(_UP, yaw) @ own,
            np.array([*(goal.center + np.array(share) * goal.half_sides), height]),
        )
        for share in _AREA_SHARES
        for yaw in turns
    )


def poses_in_cavity(
    thing: ObjectBelief, part: PartBelief, opening: float, belief: Belief | None = None
) -> Poses:
    """Label poses in which the object's bounding box rests on the cavity's floor and fits it.

    Args:
      thing: What to store.
      part: The drawer or door.
      opening: Joint position while the object is put in [m or rad].
      belief: What else there is; what lies in the cavity is kept clear of.

    Returns:
      `T_world_label`: those first that keep the side that is down now, then lying ones, which are
      easiest to shut away; towards the front.
    """
    cavity = part.cavity
    if cavity is None:
        return ()
    carrier = part.base_pose
    if cavity.moves_with_part and part.joint.kind == "slide":
        carrier = part.base_pose @ joint_motion(part, opening)
    front = outwards(part)
    across = np.cross(_UP, front)
    shares = _DRAWER_FRONT if cavity.moves_with_part else _DOOR_FRONT
    taken = [] if belief is None else _boxes_inside(belief, thing, part)
    down = thing.label_pose[2, :3]
    found = []
    for rotation in _ways_to_turn(thing):
        reach = np.abs(rotation) @ thing.label.extents / 2
        slack = (cavity.extents - CAVITY_MARGIN) / 2 - reach
        if (slack < 0).any():
            continue
        height = resting_height(thing, rotation) if thing.rests else reach[2]
        floor = np.array([0.0, 0.0, height + DROP_HEIGHT - cavity.extents[2] / 2])
        other_side = float(rotation[2] @ down) < _SAME_SIDE
        count = 0
        for sideways in _SIDEWAYS:
            for share in shares:
                place_ = (share * front + sideways * across) * slack
                if count == _MAX_PER_WAY or _meets(place_, reach, taken):
                    continue
                count += 1
                pose = carrier @ compose(rotation, cavity.center + floor + place_)
                found.append((other_side, round(reach[2], 4), abs(sideways), -share, pose))
    found.sort(key=lambda entry: entry[:4])
    return tuple(entry[4] for entry in found)


Box = tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]


def _boxes_inside(belief: Belief, thing: ObjectBelief, part: PartBelief) -> list[Box]:
    """Middle and half lengths along x and y of what lies in the cavity, from the cavity's middle [m]."""
    assert part.cavity is not None
    carrier = part.pose if part.cavity.moves_with_part else part.base_pose
    boxes = []
    for other in belief.objects.values():
        if other.name != thing.name and lies_inside(other, part):
            pose = invert(carrier) @ other.label_pose
            reach = np.abs(pose[:3, :3]) @ other.label.extents / 2
            boxes.append(((pose[:3, 3] - part.cavity.center)[:2], reach[:2]))
    return boxes


def _meets(place_: Float[np.ndarray, "3"], reach: Float[np.ndarray, "3"], taken: list[Box]) -> bool:
    return any(
        (np.abs(place_[:2] - middle) < reach[:2] + half + _APART).all() for middle, half in taken
    )


def _ways_to_turn(thing: ObjectBelief) -> list[Float[np.ndarray, "3 3"]]:
    """Stable poses in quarter turns; where none are known the 24 rotations of a cube, of an axial
    label those that differ."""
    if thing.rests:
        return [
            resting_rotation(thing, rest, quarter * np.pi / 2)
            for rest in thing.rests
            for quarter in range(4)
        ]
    quarter = [
        [rotation_about(np.eye(3)[axis], k * np.pi / 2) for k in range(4)] for axis in (0, 2)
    ]
    tilts = [rotation_about(np.eye(3)[1], k * np.pi / 2) for k in (1, 3)]
    first = [x for x in quarter[0]] + tilts
    rotations = [np.round(z @ x) for x in first for z in quarter[1]]
    if not thing.label.symmetry.axial:
        return rotations
    return [
        rotation
        for i, rotation in enumerate(rotations)
        if not any(np.allclose(rotation[:, 0], other[:, 0]) for other in rotations[:i])
    ]
