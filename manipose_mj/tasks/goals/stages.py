"""Stages of progress towards a goal, for dense rewards: pure functions of the scene's state, in [0, 1].

An object is reached for (to 0.15), held (to 0.3), carried (to 0.8), and from there on, where it shall
be, let go of and at rest (1). A drawer or door is reached for (to 0.3) and moved (to 1).
"""

from __future__ import annotations

from jaxtyping import Bool, Float

from manipose_mj.poses import Array, namespace
from manipose_mj.tasks.goals.conditions import Tolerance
from manipose_mj.tasks.scene.state import ObjectState, PartState, SceneState

PLACED = 0.8  # progress from which on an object is where it shall be
_REACH_SCALE = 0.25  # distance at which a quarter of the reach is left [m]
_CARRY_SCALE = 0.3  # the same for what is carried [m]; a half turn counts as so much
_OPEN_ENOUGH = 0.8  # of a joint's range, for something to pass
_REACHING, _HOLDING = 0.15, 0.15
_OPENING = 0.35  # share of opening up in getting something in or out


def near(distance: Float[Array, "*#b"], scale: float) -> Float[Array, "*#b"]:
    """1 at no distance, a quarter left at `scale`, falling smoothly."""
    xp = namespace(distance)
    return 1 - xp.tanh(distance / scale)


def reach(state: SceneState, target: Float[Array, "*#b 3"]) -> Float[Array, "*#b"]:
    """How near the TCP is to a point of the world."""
    xp = namespace(target)
    gap = state.tcp_pose[..., :3, 3] - target
    return near(xp.sqrt(xp.sum(gap**2, axis=-1)), _REACH_SCALE)


def object_progress(
    state: SceneState,
    obj: ObjectState,
    placed: Bool[Array, "*#b"],
    remaining: Float[Array, "*#b"],
    tolerance: Tolerance,
) -> Float[Array, "*#b"]:
    """Progress of an object that is to be brought somewhere and let go.

    Args:
      state: Of the scene.
      obj: The object.
      placed: Whether it is where it shall be.
      remaining: How far it has to go [m]; half a turn counts 0.3.
      tolerance: When it counts as at rest.
    """
    xp = namespace(remaining)
    slow = near(
        obj.linear_speed / tolerance.linear_speed + obj.angular_speed / tolerance.angular_speed,
        4.0,
    )
    held = xp.asarray(obj.held, dtype=remaining.dtype)
    free = 1 - xp.asarray(obj.touched, dtype=remaining.dtype)
    released = PLACED + 0.1 * free + 0.1 * slow
    # Holding counts in full from the reach on, so that letting go on the way never pays.
    held = (
        _REACHING * xp.maximum(reach(state, obj.label_pose[..., :3, 3]), held)
        + _HOLDING * held
        + (PLACED - _REACHING - _HOLDING) * near(remaining, _CARRY_SCALE)
    )
    return xp.where(placed, released, held)


def turn_as_distance(angle: Float[Array, "*#b"]) -> Float[Array, "*#b"]:
    """A turn [rad] in the units of a distance [m]."""
    return angle * (0.3 / 3.14159)


def part_progress(
    state: SceneState, part: PartState, moved: Float[Array, "*#b"]
) -> Float[Array, "*#b"]:
    """Progress of a drawer or door of whose motion `moved`, in [0, 1], is done."""
    xp = namespace(moved)
    moved = xp.clip(moved, 0.0, 1.0)
    reached = xp.maximum(reach(state, part.handle_pose[..., :3, 3]), moved)
    return 0.3 * reached + 0.7 * moved


def through_part(
    state: SceneState,
    part: PartState,
    placed: Bool[Array, "*#b"],
    progress: Float[Array, "*#b"],
) -> Float[Array, "*#b"]:
    """Progress of an object that has to pass a drawer or door: opening this comes first.

    Args:
      state: Of the scene.
      part: What has to be open.
      placed: Whether the object is where it shall be; the part may then be shut again.
      progress: Of the object by itself.
    """
    xp = namespace(progress)
    opened = xp.clip(part.fraction / _OPEN_ENOUGH, 0.0, 1.0)
    opening = _OPENING * part_progress(state, part, opened)
    passing = xp.where(opened >= 1.0, _OPENING + (1 - _OPENING) * progress, opening)
    return xp.where(placed, progress, passing)
