"""A symbolic planner: from a goal and a belief to a plan of primitives."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.belief import Belief, ObjectBelief, PartBelief
from manipose_mj.control.plan import Plan, Step
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.goals import Goal, InsideGoal, PoseGoal, ShutGoal

# How far to open, of the joint's range: all the way would ram the stop.
OPEN_SHARE = 0.95
OPEN_ENOUGH = 0.85
SHUT_ENOUGH = 0.005  # of a joint [m or rad]
# The object is let go this high above the surface it shall rest on [m].
DROP_HEIGHT = 0.002
CAVITY_MARGIN = 0.01
# Where in the cavity, as a share of the free way from its middle to its front: the hand that sets
# something down needs room in front of what is above.
FRONT_SHIFTS = (0.35, 0.5, 0.2)


def make_plan(goals: tuple[Goal, ...], belief: Belief) -> Plan:
    """Steps that reach the goals, one after the other, from what is believed.

    Raises:
      InputError: A goal names something that is not there, or an object fits a cavity in no
        orientation.
    """
    plan: Plan = ()
    opened: set[str] = set()
    for goal in goals:
        if isinstance(goal, PoseGoal):
            plan += _place(goal.object, (goal.pose,))
        elif isinstance(goal, InsideGoal):
            plan += _put_inside(goal, belief)
            opened.add(goal.part)
        elif isinstance(goal, ShutGoal):
            part = belief.parts[goal.part]
            if goal.part in opened or part.opening > part.joint.range[0] + SHUT_ENOUGH:
                plan += _move_part(goal.part, part.joint.range[0])
    return plan


def _put_inside(goal: InsideGoal, belief: Belief) -> Plan:
    """Open the part unless it is, and put the object behind it."""
    part = belief.parts[goal.part]
    low, high = part.joint.range
    opened = low + OPEN_SHARE * (high - low)
    poses = poses_in_cavity(belief.objects[goal.object], part, opened)
    if not poses:
        raise InputError(f"{goal.object} fits the cavity of {goal.part} in no orientation")
    plan: Plan = ()
    if part.opening < low + OPEN_ENOUGH * (high - low):
        plan += _move_part(goal.part, opened)
    return plan + _place(goal.object, poses)


def _place(name: str, poses: tuple[Float[np.ndarray, "4 4"], ...]) -> Plan:
    return (Step("grasp_at", name), Step("move_to", name, poses=poses), Step("release", name))


def _move_part(name: str, opening: float) -> Plan:
    return (Step("grasp_at", name), Step("move_to", name, opening=opening), Step("release", name))


def poses_in_cavity(
    thing: ObjectBelief, part: PartBelief, opening: float
) -> tuple[Float[np.ndarray, "4 4"], ...]:
    """Label poses in which the object's bounding box rests on the cavity's floor and fits it.

    Args:
      thing: What to store; only its extents matter.
      part: The drawer or door.
      opening: Joint position while the object is put in [m or rad].

    Returns:
      `T_world_label`, lying ones first, which are easiest to shut away, and towards the front.
    """
    cavity = part.cavity
    if cavity is None:
        return ()
    carrier = part.base_pose
    if cavity.moves_with_part and part.joint.kind == "slide":
        carrier = part.base_pose @ compose(np.eye(3), part.joint.axis * opening)
    outwards = part.handle.rotation[:, 1]
    found = []
    for rotation in _axis_aligned_rotations():
        reach = np.abs(rotation) @ thing.label.extents / 2
        slack = (cavity.extents - CAVITY_MARGIN) / 2 - reach
        if (slack < 0).any():
            continue
        floor = np.array([0.0, 0.0, -cavity.extents[2] / 2 + reach[2] + DROP_HEIGHT])
        for shift in FRONT_SHIFTS:
            center = cavity.center + floor + shift * outwards * slack
            found.append((reach[2], -shift, carrier @ compose(rotation, center)))
    found.sort(key=lambda entry: (round(entry[0], 4), entry[1]))
    return tuple(pose for _, _, pose in found)


def _axis_aligned_rotations() -> list[Float[np.ndarray, "3 3"]]:
    """The 24 rotations of a cube."""
    quarter = [
        [rotation_about(np.eye(3)[axis], k * np.pi / 2) for k in range(4)] for axis in (0, 2)
    ]
    tilts = [rotation_about(np.eye(3)[1], k * np.pi / 2) for k in (1, 3)]
    first = [x for x in quarter[0]] + tilts
    return [np.round(z @ x) for x in first for z in quarter[1]]
