"""Where the hand is while it moves a drawer or door: around the handle's bar, before it, or behind the door."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.articulated.part_shape import PartShape

_TILT_STEP = radians(15)
_GRIP_TILT, _PUSH_TILT = radians(75), radians(90)
_INSET = 0.022  # of a push on a door's inside, from its free edge [m]
# Of a grip, by the front of what it holds: at least [m], and of the depth of a bar and of a knob.
_BACK, _BACK_SHARE, _KNOB_SHARE = 0.004, 0.25, 0.5
_BEFORE = 0.002  # of a grip by the fingertips, from the bar's front [m]
_TIP = 0.009  # from the TCP to the closed fingers' tips [m]
_SHARES = (1.0, 0.6, 0.35)  # of a door's radius, where it may be pushed


@dataclass(frozen=True)
class HandPlaces:
    """Ways to touch a part from one side, which differ by the tilt of the hand.

    Attributes:
      poses: `T_part_tcp`, tilt by tilt, 15 degrees apart.
      opening: Of the fingers, which reach past what is between them [m]; None: their tips press on the part.
    """

    poses: Float[np.ndarray, "t 4 4"]
    opening: float | None = None


def around_the_bar(part: MovingPart, *, fingertips: bool = False) -> tuple[HandPlaces, ...]:
    """Grips of the handle's bar, and across it where it is short; the hand comes along -Y of the label.

    `fingertips`: only by its front.
    """
    handle = part.handle
    assert handle is not None
    x, out, z = handle.rotation.T
    along, depth, across = handle.extents
    back = max(_BACK, (_KNOB_SHARE if along < MAX_OPENING else _BACK_SHARE) * depth)
    if fingertips:
        back = depth / 2 + _BEFORE
    bars = [(x, across), (z, along)] if along < MAX_OPENING else [(x, across)]
    return tuple(
        HandPlaces(_tilted(handle.origin, out, bar, bar, _GRIP_TILT, back), float(width))
        for bar, width in bars
    )


def before_the_bar(part: MovingPart) -> tuple[HandPlaces, ...]:
    """Pushes on the handle's front, which shut the part: the fingers side by side, or one over the other."""
    handle = part.handle
    assert handle is not None
    x, out = handle.rotation[:, 0], handle.rotation[:, 1]
    axis = x
    if part.joint.kind == "hinge":
        axis = part.joint.axis - (part.joint.axis @ out) * out
        axis /= np.linalg.norm(axis)
    front = handle.origin + out * handle.extents[1] / 2
    return tuple(
        HandPlaces(_tilted(front, out, axis, across, _PUSH_TILT, _TIP))
        for across in (axis, np.cross(axis, out))
    )


def on_the_front(part: MovingPart, shape: PartShape) -> tuple[HandPlaces, ...]:
    """Pushes on a door's front, near its free edge and nearer to its hinge, which shut it."""
    assert part.handle is not None
    if part.joint.kind == "slide":
        return ()
    return _on_a_face(part, shape, part.handle.rotation[:, 1])


def behind_the_door(part: MovingPart, shape: PartShape) -> tuple[HandPlaces, ...]:
    """Pushes on a door's inside, which open it further, near its free edge and nearer to its hinge."""
    assert part.handle is not None
    return _on_a_face(part, shape, -part.handle.rotation[:, 1])


def _on_a_face(
    part: MovingPart, shape: PartShape, normal: Float[np.ndarray, "3"]
) -> tuple[HandPlaces, ...]:
    """Pushes on the face of a door with this normal."""
    handle, axis = part.handle, part.joint.axis
    assert handle is not None
    radial = np.cross(axis, normal)
    radial *= np.sign(radial @ (handle.origin - part.joint.origin))
    low, high = shape.moving
    center, half = (low + high) / 2, (high - low) / 2
    face = center @ normal + half @ np.abs(normal)
    edge = center @ radial + half @ np.abs(radial) - _INSET
    hinge = part.joint.origin @ radial
    height = handle.origin @ axis
    found = []
    for share in _SHARES:
        point = face * normal + (hinge + share * (edge - hinge)) * radial + height * axis
        for across in (axis, np.cross(axis, normal)):
            found.append(HandPlaces(_tilted(point, normal, axis, across, _PUSH_TILT, _TIP)))
    return tuple(found)


def chained(
    free: Bool[np.ndarray, "c k t"], steps: int, *, seed: Bool[np.ndarray, "c t"] | None = None
) -> Bool[np.ndarray, "c k t"]:
    """Which places can be come to from the first layer, where the tilt changes little from layer to layer.

    Args:
      free: Whether each place of each layer can be taken.
      steps: By how many tilts two layers may differ.
      seed: Of the first layer those to begin with; None: all that are free.
    """
    reached = free.copy()
    if seed is not None:
        reached[:, 0] &= seed
    for k in range(1, free.shape[1]):
        padded = np.pad(reached[:, k - 1], ((0, 0), (steps, steps)))
        near = [padded[:, j : j + free.shape[2]] for j in range(2 * steps + 1)]
        reached[:, k] &= np.any(near, axis=0)
    return reached


def _tilted(
    point: Float[np.ndarray, "3"],
    normal: Float[np.ndarray, "3"],
    axis: Float[np.ndarray, "3"],
    across: Float[np.ndarray, "3"],
    limit: float,
    reach: float,
) -> Float[np.ndarray, "t 4 4"]:
    """TCP poses over a point of a surface, tilted about an axis in it; `across` is the hand's x untilted."""
    count = round(limit / _TILT_STEP)
    poses = []
    for tilt in _TILT_STEP * np.arange(-count, count + 1):
        turn = rotation_about(axis, float(tilt))
        x, approach = turn @ across, turn @ -normal
        rotation = np.stack([x, np.cross(approach, x), approach], axis=1)
        poses.append(compose(rotation, point + reach * normal))
    return np.stack(poses)
