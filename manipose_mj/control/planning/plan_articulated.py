"""Plans around drawers and doors: open them, put objects behind them, take objects out, shut them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.cavity_places import lies_inside, poses_in_cavity
from manipose_mj.control.planning.plan import Plan, Step
from manipose_mj.control.planning.regrasp import Poses, routes
from manipose_mj.control.planning.table_places import (
    DROP_HEIGHT,
    YAWS,
    resting_height,
)
from manipose_mj.control.planning.transport import place_at_each
from manipose_mj.control.scene.articulation import with_part_at
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate, SceneEstimate
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, invert, rotation_about
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
_BESIDE_AREA = 0.005  # how far from the area of its goal an object is seen to be at most [m]
_STICKS_OUT = 0.003  # of a cavity, by which an object may [m]
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
    """Whether a part is seen to stand, or what it hides or hid to lie, otherwise than a goal has it."""
    for goal in goals:
        if isinstance(goal, InsideGoal | TakenOutGoal) and _lies_elsewhere(goal, estimate):
            return True
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


def _lies_elsewhere(goal: InsideGoal | TakenOutGoal, estimate: SceneEstimate) -> bool:
    """Whether the object is known to be neither in the cavity nor over the area where it shall be."""
    obj = estimate.objects.get(goal.object)
    if obj is None:
        return False
    if isinstance(goal, InsideGoal):
        return not lies_inside(obj, estimate.parts[goal.part])
    return not _in_area(goal, obj, _BESIDE_AREA)


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
    return not lies_inside(obj, part) and _in_area(goal, obj)


def leads_through(goal: InsideGoal | TakenOutGoal, estimate: SceneEstimate) -> bool:
    """Whether the object has to pass the part; what lies outside already can be put elsewhere with the part shut."""
    if isinstance(goal, InsideGoal):
        return not is_reached(goal, estimate)
    return lies_inside(estimate.objects[goal.object], estimate.parts[goal.part])


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
    through = leads_through(goal, estimate)
    opening = _open(part, wide_open) if through and not _lets_pass(part) else ()
    if planner is None or lies_inside(obj, part):
        yield opening + place_at_each(goal.object, (poses,))
        return
    if through:
        planner = planner.within(with_part_at(planner.scene, part, max(wide_open, part.opening)))
    for stops in routes(planner, estimate, obj, poses):
        yield opening + place_at_each(goal.object, stops)
    if isinstance(goal, InsideGoal):
        tight = poses_in_cavity(obj, part, wide_open, estimate, others=True)
        if tight:
            yield opening + place_at_each(goal.object, (tight,))


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


def _in_area(goal: TakenOutGoal, obj: ObjectEstimate, beside: float = 0.0) -> bool:
    """Whether the object is over the goal's area, or `beside` it by no more [m]."""
    away = np.abs(obj.label_pose[:2, 3] - np.asarray(goal.center))
    return bool((away <= np.asarray(goal.half_sides) + beside).all())


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
