"""Plans around drawers and doors: open them, put objects behind them, take objects out, shut them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan import Plan, Step
from manipose_mj.control.planning.regrasp import Poses, routes
from manipose_mj.control.planning.table_places import (
    DROP_HEIGHT,
    YAWS,
    rest_of,
    resting_height,
    resting_rotation,
)
from manipose_mj.control.planning.transport import place_at_each
from manipose_mj.control.scene.articulation import joint_motion, with_part_at
from manipose_mj.control.scene.cavity_mouth import outwards
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate, SceneEstimate
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, invert, rotation_about
from manipose_mj.tasks.articulated.cavity_placement import MIN_GRASPS
from manipose_mj.tasks.articulated.hand_room import (
    STRAIGHT,
    TILTED,
    Placement,
    count_clear,
    hands_around,
)
from manipose_mj.tasks.articulated.part_shape import WIDE_OPEN
from manipose_mj.tasks.goals import Goal, InsideGoal, OpenGoal, ShutGoal, TakenOutGoal

PartGoal = InsideGoal | TakenOutGoal | OpenGoal | ShutGoal

# How far to open, of the joint's range: all the way would ram the stop.
OPEN_SHARE = 0.95
OPEN_ENOUGH = 0.85
AJAR = 0.3  # from which on a door can be pushed from inside [rad]
SHUT_ENOUGH = 0.005  # of a joint [m or rad]
_LEFT_OVER = (0.7, 0.4, 0.85)  # of a door's opening, by the first of two pushes
# From which openings on a part that is estimated stands otherwise than it should: of its range, [m or rad].
NOT_OPEN, NOT_SHUT = 0.08, {"slide": 0.012, "hinge": 0.05}
CAVITY_MARGIN = np.array([0.010, 0.010, 0.004])  # in all, along each axis [m]
# Where in the cavity, as a share of the free way from its middle to its front: the hand that sets
# something down needs room in front of what is above, or beside, or both.
_DRAWER_FRONT = (0.35, 0.5, 0.2, 0.7, 0.95, 0.0, -0.3, -0.6)
_DOOR_FRONT = (0.95, 0.75, 0.5, 0.25)
_SIDEWAYS = (0.0, 0.3, -0.3, 0.6, -0.6, 0.95, -0.95)
_MAX_PER_WAY = 3  # places in the cavity for each way to lie
_AT_LEAST_DRAWN = 0.01  # a drawer that somebody reaches into [m]
_ENOUGH_HANDS = 8  # grasps with room for the hand, from which on more make no place better
_STICKS_OUT = 0.003  # of a cavity, by which an object may [m]
_APART = 0.008  # between objects that lie side by side [m]
_SAME_SIDE = 0.95  # cosine from which on two verticals are one
_AREA_SHARES = ((0.0, 0.0), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5))
_UP = np.array([0.0, 0.0, 1.0])


def part_goal_plans(
    goal: PartGoal,
    estimate: SceneEstimate,
    planner: MotionPlanner | None,
    opened: frozenset[str] = frozenset(),
) -> Iterator[Plan]:
    """Plans that reach one goal, the most promising first.

    Args:
      goal: What to reach.
      estimate: What is where.
      planner: Of motions in the scene of `estimate`; without one nothing is set down on the way.
      opened: Parts that are open by then, because of the steps before.

    Raises:
      InputError: An object fits a cavity in no orientation.
    """
    part = estimate.parts[goal.part]
    low, high = part.joint.range
    if isinstance(goal, ShutGoal):
        shut = goal.part not in opened and part.opening <= low + SHUT_ENOUGH
        if shut:
            yield ()
            return
        yield (Step("move_to", goal.part, opening=low),)
        # What no push shuts is led by its handle, and then pushed on from where the hand can lead it no further.
        yield (*_led(goal.part, low), Step("move_to", goal.part, opening=low))
        # A door that no single push shuts is pushed twice, in other places; how far it will be open has to be known.
        known = part.joint.kind == "hinge" and goal.part not in opened
        for share in _LEFT_OVER if known else ():
            between = low + share * (part.opening - low)
            yield tuple(Step("move_to", goal.part, opening=each) for each in (between, low))
    elif isinstance(goal, OpenGoal):
        share = max(OPEN_SHARE, min((1 + goal.fraction) / 2, 1.0))
        is_open = part.opening >= low + goal.fraction * (high - low)
        if is_open:
            yield ()
            return
        wide_open = low + share * (high - low)
        yield _open(part, wide_open)
        if part.joint.kind == "hinge" and part.opening > low + AJAR:
            yield (Step("move_to", goal.part, opening=wide_open),)
    elif is_reached(goal, estimate):
        yield ()
    else:
        yield from _plans_through(goal, estimate, planner, part)


def parts_to_look_behind(goals: tuple[Goal, ...], estimate: SceneEstimate) -> tuple[str, ...]:
    """Parts that have to be opened before anybody can plan: what is behind them is not known.

    Args:
      goals: All of them.
      estimate: What is where.
    """
    return tuple(
        goal.part
        for goal in goals
        if isinstance(goal, InsideGoal | TakenOutGoal)
        and (goal.object not in estimate.objects or not estimate.parts[goal.part].cavity_seen)
    )


def stand_wrong(goals: tuple[Goal, ...], estimate: SceneEstimate) -> bool:
    """Whether a part is seen to stand otherwise than a goal has it."""
    for goal in goals:
        if not isinstance(goal, OpenGoal | ShutGoal):
            continue
        part = estimate.parts[goal.part]
        low, high = part.joint.range
        share = (part.opening - low) / (high - low)
        if isinstance(goal, OpenGoal):
            wrong = part.goes_on or share < float(goal.fraction) - NOT_OPEN
        elif goal.fraction is not None:
            wrong = share > 1 - float(goal.fraction)
        else:
            wrong = part.opening - low > NOT_SHUT[part.joint.kind]
        if wrong:
            return True
    return False


def opening_plans(name: str, estimate: SceneEstimate) -> Iterator[Plan]:
    """Plans that open a part, to see what is behind it; no steps where it is open."""
    part = estimate.parts[name]
    if _lets_pass(part):
        yield ()
        return
    wide_open = opening_to_pass(part)
    yield _open(part, wide_open)
    if part.joint.kind == "hinge" and part.opening > part.joint.range[0] + AJAR:
        yield (Step("move_to", name, opening=wide_open),)


def is_reached(goal: InsideGoal | TakenOutGoal, estimate: SceneEstimate) -> bool:
    """Whether the object is where the goal has it."""
    obj, part = estimate.objects[goal.object], estimate.parts[goal.part]
    if isinstance(goal, InsideGoal):
        return _lies_all_inside(obj, part)
    return not lies_inside(obj, part) and _near_one(obj, poses_in_area(goal, obj))


def _plans_through(
    goal: InsideGoal | TakenOutGoal,
    estimate: SceneEstimate,
    planner: MotionPlanner | None,
    part: PartEstimate,
) -> Iterator[Plan]:
    """Plans that open the part where it is shut, and bring the object into it or out of it."""
    obj, wide_open = estimate.objects[goal.object], opening_to_pass(part)
    if isinstance(goal, InsideGoal):
        poses = poses_in_cavity(obj, part, wide_open, estimate)
        if not poses:
            raise InputError(f"{goal.object} fits the cavity of {goal.part} in no orientation")
    else:
        poses = poses_in_area(goal, obj)
    opening = () if _lets_pass(part) else _open(part, wide_open)
    if planner is None or lies_inside(obj, part):
        yield opening + place_at_each(goal.object, (poses,))
        return
    by_then = with_part_at(planner.scene, part, max(wide_open, part.opening))
    for stops in routes(planner.within(by_then), estimate, obj, poses):
        yield opening + place_at_each(goal.object, stops)


def opening_to_pass(part: PartEstimate) -> float:
    """How far a part is opened for a hand to pass with what it holds [m or rad]."""
    low, high = part.joint.range
    wide_open = OPEN_SHARE * (high - low)
    return low + (min(wide_open, WIDE_OPEN) if part.joint.kind == "hinge" else wide_open)


def _lets_pass(part: PartEstimate) -> bool:
    low = part.joint.range[0]
    return part.opening >= low + OPEN_ENOUGH / OPEN_SHARE * (opening_to_pass(part) - low)


def _open(part: PartEstimate, opening: float) -> Plan:
    """By the handle; a door that the hand cannot lead all the way is then pushed on from inside."""
    plan = _led(part.name, opening)
    if part.joint.kind == "slide":
        return plan
    return (*plan, Step("move_to", part.name, opening=opening))


def _led(name: str, opening: float) -> Plan:
    """By the handle."""
    return (
        Step("grasp_at", name),
        Step("move_to", name, opening=opening),
        Step("release", name),
    )


def lies_inside(obj: ObjectEstimate, part: PartEstimate) -> bool:
    """Whether the object's middle is in the part's cavity."""
    if part.cavity is None:
        return False
    carrier = part.pose if part.cavity.moves_with_part else part.base_pose
    place_ = (invert(carrier) @ obj.label_pose)[:3, 3] - part.cavity.center
    return bool((np.abs(place_) < part.cavity.extents / 2).all())


def _lies_all_inside(obj: ObjectEstimate, part: PartEstimate) -> bool:
    """Whether no corner of the object sticks out of the part's cavity by much."""
    if part.cavity is None:
        return False
    carrier = part.pose if part.cavity.moves_with_part else part.base_pose
    pose = invert(carrier) @ obj.label_pose
    reach = obj.label.reach(pose[:3, :3])[:2]
    middle = (pose[:3, :3] @ obj.label.center + pose[:3, 3] - part.cavity.center)[:2]
    sideways = np.abs(middle) + reach <= part.cavity.extents[:2] / 2 + _STICKS_OUT
    return lies_inside(obj, part) and bool(sideways.all())


def _near_one(obj: ObjectEstimate, poses: Poses) -> bool:
    """Whether the object is at one of the places already, turned as it may be."""
    places = np.stack([pose[:3, 3] for pose in poses])
    return bool((np.linalg.norm(places - obj.label_pose[:3, 3], axis=1) < 0.05).any())


def poses_in_area(goal: TakenOutGoal, obj: ObjectEstimate) -> Poses:
    """`T_world_label` in the goal area, resting on the side that is down now."""
    own = obj.label_pose[:3, :3]
    height = resting_height(obj, own) + DROP_HEIGHT
    turns = YAWS[:1] if obj.label.symmetry.axial and abs(own[2, 0]) > 0.99 else YAWS
    return tuple(
        compose(
            rotation_about(_UP, yaw) @ own,
            np.array([*(goal.center + np.array(share) * goal.half_sides), height]),
        )
        for share in _AREA_SHARES
        for yaw in turns
    )


def poses_in_cavity(
    obj: ObjectEstimate, part: PartEstimate, opening: float, estimate: SceneEstimate | None = None
) -> Poses:
    """Label poses in which the object's bounding box rests on the cavity's floor and fits it.

    Args:
      obj: What to store.
      part: The drawer or door.
      opening: Joint position while the object is put in [m or rad].
      estimate: What else there is; what lies in the cavity is kept clear of.

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
    taken = [] if estimate is None else _boxes_inside(estimate, obj, part)
    open_side = _UP if cavity.moves_with_part else front
    down = obj.label_pose[2, :3]
    drawn = None
    if cavity.moves_with_part and part.joint.kind == "slide":
        drawn = front[:2] * max(opening - part.joint.range[0], _AT_LEAST_DRAWN)
    found = []
    rotations = _ways_to_turn(obj)
    towards = _hand_towards(obj, rotations, open_side)
    room = (cavity.extents - CAVITY_MARGIN) / 2
    boxes = [(rotation @ obj.label.center, obj.label.reach(rotation)) for rotation in rotations]
    if estimate is not None and not any((reach <= room).all() for _, reach in boxes):
        # A box around a box that is tilted is larger than one around what tapers.
        boxes = [obj.box_around(estimate.scene, rotation) for rotation in rotations]
    if obj.uncertainty > 0 and not any((reach <= room).all() for _, reach in boxes):
        room = room + obj.uncertainty  # it may be that much smaller
    for rotation, (middle, reach) in zip(rotations, boxes, strict=True):
        slack = room - reach
        if (slack < 0).any():
            continue
        height = resting_height(obj, rotation) if obj.rests else reach[2]
        floor = np.array([0.0, 0.0, height + DROP_HEIGHT - cavity.extents[2] / 2])
        other_side = float(rotation[2] @ down) < _SAME_SIDE
        hands = _hands(obj, rotation, open_side, towards)
        # From the middle of its box to the label's origin, and on to the object's.
        to_label = -middle * [1, 1, 0]
        to_object = to_label - rotation @ obj.label.rotation.T @ obj.label.origin
        places = []
        for sideways in _SIDEWAYS:
            for share in shares:
                place_ = (share * front + sideways * across) * slack
                if _meets(place_, reach, taken):
                    continue
                # Without grasps that are known to come from there, any place is as good.
                at = floor + place_ + to_object
                clear = count_clear(hands, at, cavity, open_side, taken, drawn)
                places.append((-min(clear, _ENOUGH_HANDS), abs(sideways), -share, place_))
        # Stable: of places with as much room those come first that come first above.
        places.sort(key=lambda entry: entry[0])
        for clear, off, back, place_ in places[:_MAX_PER_WAY]:
            pose = carrier @ compose(rotation, cavity.center + floor + place_ + to_label)
            found.append((other_side, clear, round(reach[2], 4), off, back, pose))
    found.sort(key=lambda entry: entry[:5])
    return tuple(entry[5] for entry in found)


def _hand_towards(
    obj: ObjectEstimate,
    rotations: list[Float[np.ndarray, "3 3"]],
    open_side: Float[np.ndarray, "3"],
) -> float:
    """`STRAIGHT`; `TILTED` where too few grasps lead straight through an open side in front."""
    from_above = open_side[2] > _SAME_SIDE
    straight = (len(_hands(obj, turned, open_side, STRAIGHT)) for turned in rotations)
    return STRAIGHT if from_above or any(count >= MIN_GRASPS for count in straight) else TILTED


def _hands(
    obj: ObjectEstimate,
    rotation: Float[np.ndarray, "3 3"],
    open_side: Float[np.ndarray, "3"],
    towards: float,
) -> Float[np.ndarray, "k b 8 3"]:
    """The hand at the grasps that are left when the object's label is turned so in a cavity."""
    rest = rest_of(obj, rotation)
    if rest is None:
        return np.zeros((0, 3, 8, 3))
    return hands_around(obj.grasps, rest, rotation @ obj.label.rotation.T, open_side, towards)


def _boxes_inside(
    estimate: SceneEstimate, obj: ObjectEstimate, part: PartEstimate
) -> list[Placement]:
    """What lies in the cavity."""
    assert part.cavity is not None
    carrier = part.pose if part.cavity.moves_with_part else part.base_pose
    boxes = []
    for other in estimate.objects.values():
        if other.name != obj.name and lies_inside(other, part):
            pose = invert(carrier) @ other.label_pose
            reach = other.label.reach(pose[:3, :3])
            middle = pose[:3, :3] @ other.label.center + pose[:3, 3]
            boxes.append(Placement((middle - part.cavity.center)[:2], reach))
    return boxes


def _meets(
    place_: Float[np.ndarray, "3"], reach: Float[np.ndarray, "3"], taken: list[Placement]
) -> bool:
    return any(
        (np.abs(place_[:2] - other.place) < reach[:2] + other.reach[:2] + _APART).all()
        for other in taken
    )


def _ways_to_turn(obj: ObjectEstimate) -> list[Float[np.ndarray, "3 3"]]:
    """Stable poses in quarter turns; where none are known the 24 rotations of a cube, of an axial
    label those that differ."""
    if obj.rests:
        return [
            resting_rotation(obj, rest, quarter * np.pi / 2)
            for rest in obj.rests
            for quarter in range(4)
        ]
    quarter = [
        [rotation_about(np.eye(3)[axis], k * np.pi / 2) for k in range(4)] for axis in (0, 2)
    ]
    tilts = [rotation_about(np.eye(3)[1], k * np.pi / 2) for k in (1, 3)]
    first = [x for x in quarter[0]] + tilts
    rotations = [np.round(z @ x) for x in first for z in quarter[1]]
    if not obj.label.symmetry.axial:
        return rotations
    return [
        rotation
        for i, rotation in enumerate(rotations)
        if not any(np.allclose(rotation[:, 0], other[:, 0]) for other in rotations[:i])
    ]
