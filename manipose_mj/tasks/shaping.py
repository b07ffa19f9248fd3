"""Stages of progress towards a goal, for dense rewards: pure functions of the scene's state, in [0, 1].

An object is reached for (to 0.15), held (to 0.3), carried (to 0.8), and from there on, where it shall
be, let go of and at rest (1). A drawer or door is reached for (to 0.3) and moved (to 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from jaxtyping import Bool, Float

from manipose_mj.poses import Array, namespace
from manipose_mj.tasks.scene_state import ObjectState, PartState, SceneState
from manipose_mj.tasks.success import Tolerance

if TYPE_CHECKING:
    from manipose_mj.tasks.goals import Goal

PLACED = 0.8  # progress from which on an object is where it shall be
_REACH_SCALE = 0.25  # distance at which a quarter of the reach is left [m]
_CARRY_SCALE = 0.3  # the same for what is carried [m]; a half turn counts as so much
_OPEN_ENOUGH = 0.8  # of a joint's range, for something to pass
_REACHING, _HOLDING = 0.15, 0.15
_OPENING = 0.35  # share of opening up in getting something in or out


def near(distance: Float[Array, "*b"], scale: float) -> Float[Array, "*b"]:
    """1 at no distance, a quarter left at `scale`, falling smoothly."""
    xp = namespace(distance)
    return 1 - xp.tanh(distance / scale)


def reach(state: SceneState, target: Float[Array, "*b 3"]) -> Float[Array, "*b"]:
    """How near the TCP is to a point of the world."""
    xp = namespace(target)
    gap = state.tcp_pose[..., :3, 3] - target
    return near(xp.sqrt(xp.sum(gap**2, axis=-1)), _REACH_SCALE)


def object_progress(
    state: SceneState,
    thing: ObjectState,
    placed: Bool[Array, "*b"],
    left: Float[Array, "*b"],
    tolerance: Tolerance,
) -> Float[Array, "*b"]:
    """Progress of an object that is to be brought somewhere and let go.

    Args:
      state: Of the scene.
      thing: The object.
      placed: Whether it is where it shall be.
      left: How far it has to go [m]; half a turn counts 0.3.
      tolerance: When it counts as at rest.
    """
    xp = namespace(left)
    slow = near(
        thing.linear_speed / tolerance.linear_speed + thing.angular_speed / tolerance.angular_speed,
        4.0,
    )
    held = xp.asarray(thing.held, dtype=left.dtype)
    free = 1 - xp.asarray(thing.touched, dtype=left.dtype)
    there = PLACED + 0.1 * free + 0.1 * slow
    # Holding counts in full from the reach on, so that letting go on the way never pays.
    under_way = (
        _REACHING * xp.maximum(reach(state, thing.label_pose[..., :3, 3]), held)
        + _HOLDING * held
        + (PLACED - _REACHING - _HOLDING) * near(left, _CARRY_SCALE)
    )
    return xp.where(placed, there, under_way)


def turn_as_way(angle: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """A turn [rad] in the units of a way [m]."""
    return angle * (0.3 / 3.14159)


def part_progress(
    state: SceneState, furniture: PartState, moved: Float[Array, "*b"]
) -> Float[Array, "*b"]:
    """Progress of a drawer or door of whose way `moved`, in [0, 1], is done."""
    xp = namespace(moved)
    moved = xp.clip(moved, 0.0, 1.0)
    reached = xp.maximum(reach(state, furniture.handle_pose[..., :3, 3]), moved)
    return 0.3 * reached + 0.7 * moved


def through_part(
    state: SceneState,
    furniture: PartState,
    placed: Bool[Array, "*b"],
    progress: Float[Array, "*b"],
) -> Float[Array, "*b"]:
    """Progress of an object that has to pass a drawer or door: opening this comes first.

    Args:
      state: Of the scene.
      furniture: What has to be open.
      placed: Whether the object is where it shall be; the part may then be shut again.
      progress: Of the object by itself.
    """
    xp = namespace(progress)
    opened = xp.clip(furniture.fraction / _OPEN_ENOUGH, 0.0, 1.0)
    opening = _OPENING * part_progress(state, furniture, opened)
    passing = xp.where(opened >= 1.0, _OPENING + (1 - _OPENING) * progress, opening)
    return xp.where(placed, progress, passing)


def dense_reward(
    goals: Sequence[Goal], state: SceneState, tolerance: Tolerance
) -> Float[Array, "*b"]:
    """Progress towards all goals, in [0, 1]; 1 where all are met.

    Neighbours of one kind count side by side, in any order; different kinds one after the other, the
    next from where the one before is all but met: a drawer that must be shut in the end gains nothing
    by staying shut.
    """
    groups: list[list[Goal]] = []
    for goal in goals:
        if groups and type(groups[-1][-1]) is type(goal):
            groups[-1].append(goal)
        else:
            groups.append([goal])
    total, open_gate = None, None
    for group in groups:
        each = [goal.progress(state, tolerance) for goal in group]
        xp = namespace(each[0])
        stacked = xp.stack(each, axis=0)
        value = xp.mean(stacked, axis=0)
        done = xp.all(stacked >= PLACED, axis=0)
        if total is None or open_gate is None:
            total, open_gate = value, done
        else:
            total = total + xp.where(open_gate, value, 0.0)
            open_gate = open_gate & done
    assert total is not None, "a task has at least one goal"
    return total / len(groups)
