"""Where a door's hinge is likely to be, from its handle and panel, when the estimated axis cannot be one."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.furniture.shapes.handle_shape import run_around

# Of what has knobs that turn about the way out of the front; parts of other categories are doors if they turn.
WITH_KNOBS = frozenset({"dishwasher", "microwave", "oven", "washing_machine"})
# How far doors open in the median of the training furniture [rad]: upright hinges by category, those of flaps, of others.
_TYPICAL_SWING = {"microwave": 1.83, "oven": 1.57, "cabinet": 1.92}
_LEVEL_SWING, _ANY_SWING = 1.57, 1.75
_STRAIGHT = 0.87  # cosine between a door's hinge and an axis of the front, at least
# Of the handle of a flap: how far from the middle at most, across, and at least, upright, of the panel's half.
_ACROSS, _UPRIGHT = 0.3, 0.5
_WIDE = 0.5  # of the panel's width, from which on a level bar is a flap's
_WIDEST = 0.85  # of doors about upright hinges: two of them take up what is wider [m]
_TALL = 1.5  # times as high as wide: no flap, unless its bar is wide
_AT_EDGE = 0.25  # how far from an edge of the panel an upright hinge may be, of the panel's width
_BESIDE = 0.5  # how far towards an upright hinge a handle may be from the middle of the panel, of its half
_INWARDS = 0.02  # how much a handle goes into the body at most as its door opens [m/rad]
_CORNER = 0.6  # across: beyond it no flap has its handle
# Of a front, which may be curved: how far its points are from its plane, how wide a strip of it is looked at to either side
# of the handle, and a gap that ends it [m], wider than the shadow of a handle; points that tell.
_FACE, _STRIP, _GAP, _TELLING = 0.04, 0.10, 0.15, 60
# Where the front beside a hinge is looked at: how far from it, within the door, and along it from the handle; how far
# behind it hinges are, of doors and of flaps, which are thicker, and from the side of the body [m].
_BESIDE_HINGE, _ALONG_HINGE, _BEHIND, _FROM_SIDE = (0.02, 0.06), 0.25, (0.010, 0.022), 0.008
_NEAR_SIDE = 0.04  # how far from there an upright hinge is that is taken to be there [m]
# Strips of a front this wide [m] are the panel's where points fill that share of them at least.
_CELL, _SHARE = 0.02, 0.25


def is_straight(axis: Float[np.ndarray, "3"]) -> bool:
    """Whether an axis, object frame, is upright or level along the front."""
    return float(np.abs(axis[1:]).max()) > _STRAIGHT


def is_level(axis: Float[np.ndarray, "3"]) -> bool:
    """Whether a flap turns about such an axis, object frame."""
    return abs(float(axis[2])) < 0.7


def usual_swing(axis: Float[np.ndarray, "3"], category: str) -> float:
    """How far doors open that turn about such an axis, object frame [rad]."""
    return _LEVEL_SWING if is_level(axis) else _TYPICAL_SWING.get(category, _ANY_SWING)


def can_be_a_door(
    origin: Float[np.ndarray, "3"],
    axis: Float[np.ndarray, "3"],
    handle: Float[np.ndarray, "4 4"],
    panel: Float[np.ndarray, "2 3"],
    length: float = 0.0,
) -> bool:
    """Whether a hinge is level with the handle in the middle, or upright and near an edge of the panel, and opens outwards.

    No handle is beside an upright hinge, nor is it a wide bar across the door. All in the object frame, as of `likely_hinge`.
    """
    if np.cross(axis, handle[:3, 3] - origin)[0] < -_INWARDS:
        return False
    if abs(axis[1]) > _STRAIGHT:
        width, height = np.ptp(panel[:, 1:], axis=0)
        return abs(float(_away(handle, panel)[1])) < _CORNER and bool(height < _TALL * width)
    if is_wide_bar(handle, panel, length):
        return False
    panel = one_of_two(handle, panel)
    side = float(np.sign(origin[1] - handle[1, 3]))
    off_edge = abs(float(panel[1 if side > 0 else 0, 1] - origin[1]))
    at_edge = off_edge < _AT_EDGE * float(np.ptp(panel[:, 1]))
    away_from_handle = side * float(_away(handle, panel)[1]) < _BESIDE
    return abs(float(axis[2])) > _STRAIGHT and at_edge and away_from_handle


def is_wide_bar(
    handle: Float[np.ndarray, "4 4"], panel: Float[np.ndarray, "2 3"], length: float
) -> bool:
    """Whether a handle lies level across the middle of a panel and takes up most of its width: a flap's, or a drawer's."""
    across, upright = np.abs(handle[1:3, 0])
    wide = length > _WIDE * float(np.ptp(panel[:, 1]))
    return bool(across > upright and wide and abs(_away(handle, panel)[1]) < _ACROSS)


def whole_front(
    points: Float[np.ndarray, "n 3"],
    front: float,
    handle: Float[np.ndarray, "4 4"],
    panel: Float[np.ndarray, "2 3"],
    off: float = _FACE,
) -> Float[np.ndarray, "2 3"]:
    """As much of a panel as is in one piece with what is behind the handle: beyond a gap there is another front.

    Args:
      points: That face out of the front, object frame [m].
      front: Of the panel, along X [m].
      handle: `T_object_handle`, shut.
      panel: Low and high corner, object frame [m].
      off: How far points of the front are from its plane [m]: it may be curved.
    """
    found, own = panel.copy(), handle[:3, 3]
    on = (np.abs(points[:, 0] - front) < off) & (points >= panel[0])[:, 1:].all(axis=1)
    on &= (points <= panel[1])[:, 1:].all(axis=1)
    face = points[on, 1:] - own[1:]
    # Upright as it is near the handle; then across, as far as it is as high there; then upright, as far as it is as wide.
    near = face[np.abs(face[:, 0]) < _STRIP]
    _end(found, own, panel, 1, near)
    _end(found, own, panel, 0, _filled(face, found - own, 0))
    _end(found, own, panel, 1, _filled(face, found - own, 1))
    return found


def _end(
    found: Float[np.ndarray, "2 3"],
    own: Float[np.ndarray, "3"],
    panel: Float[np.ndarray, "2 3"],
    axis: int,
    face: Float[np.ndarray, "n 2"],
) -> None:
    """End a panel across (0) or upright (1) where points of its face do."""
    if len(face) < _TELLING:
        return
    low, high = np.add(run_around(face[:, axis], _GAP), own[1 + axis])
    if low < own[1 + axis] < high:
        found[:, 1 + axis] = max(panel[0, 1 + axis], low), min(panel[1, 1 + axis], high)


def _filled(
    face: Float[np.ndarray, "n 2"], panel: Float[np.ndarray, "2 3"], axis: int
) -> Float[np.ndarray, "m 2"]:
    """Points of a front in strips, one after the other along an axis, of which they fill a share within the panel."""
    other = 1 - axis
    face = face[(face[:, other] >= panel[0, 1 + other]) & (face[:, other] <= panel[1, 1 + other])]
    at = np.floor(face / _CELL).astype(int)
    strips, filled = np.unique(np.unique(at, axis=0)[:, axis], return_counts=True)
    return face[
        np.isin(at[:, axis], strips[filled * _CELL >= _SHARE * np.ptp(panel[:, 1 + other])])
    ]


def one_of_two(
    handle: Float[np.ndarray, "4 4"], panel: Float[np.ndarray, "2 3"]
) -> Float[np.ndarray, "2 3"]:
    """The half of a panel that has the handle, where it is too wide for one upright door."""
    middle = panel[:, 1].mean()
    if np.ptp(panel[:, 1]) < _WIDEST:
        return panel
    half = panel.copy()
    half[1 if handle[1, 3] < middle else 0, 1] = middle
    return half


def hung(
    origin: Float[np.ndarray, "3"],
    axis: Float[np.ndarray, "3"],
    handle: Float[np.ndarray, "4 4"],
    facing: Float[np.ndarray, "n 3"],
    bounds: Float[np.ndarray, "2 3"],
) -> Float[np.ndarray, "3"]:
    """Where a hinge is that is taken to be at `origin`: just behind the front there, and within the sides of the body.

    Args:
      origin: A point of the axis, object frame [m], of a door that is shut.
      axis: Of the hinge, upright or level.
      handle: `T_object_handle`.
      facing: Points that face out of the front, object frame [m].
      bounds: Low and high corner of the body, object frame [m].
    """
    across, along = (2, 1) if is_level(axis) else (1, 2)
    found, own = origin.copy(), handle[:3, 3]
    side = float(np.sign(origin[across] - own[across]))
    end = side * float(bounds[1 if side > 0 else 0, across]) - _FROM_SIDE
    if across == 1 and side * found[across] > end - _NEAR_SIDE:
        found[across] = side * end
    inside = side * (found[across] - facing[:, across])
    beside = (inside > _BESIDE_HINGE[0]) & (inside < _BESIDE_HINGE[1])
    beside &= np.abs(facing[:, along] - own[along]) < _ALONG_HINGE
    beside &= np.abs(facing[:, 0] - origin[0]) < 2 * _FACE
    if beside.sum() >= _TELLING:
        behind = float(np.median(facing[beside, 0])) - _BEHIND[int(across == 2)]
        found[0] = (origin[0] + behind) / 2
    return found


def likely_hinge(
    handle: Float[np.ndarray, "4 4"], panel: Float[np.ndarray, "2 3"], length: float = 0.0
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """A point of the axis and its direction, positive is opening: along the edge that is farthest from the handle.

    Doors turn about the vertical. A flap, whose handle lies level in the middle of an upper or lower edge, turns about
    the level; one whose bar is wide does so as well, and opens downwards if its bar is near no edge.

    Args:
      handle: `T_object_handle`, shut.
      panel: Low and high corner, object frame, between its neighbours and the body's sides [m].
      length: Of the handle [m]; 0 where it is not known.
    """
    along, away = np.abs(handle[:3, 0]), _away(handle, panel)
    middle, half = panel.mean(axis=0), np.ptp(panel, axis=0) / 2
    edge = abs(away[2]) > _UPRIGHT and half[2] < _TALL * half[1]
    edge = along[1] > along[2] and abs(away[1]) < _ACROSS and edge
    level = edge or is_wide_bar(handle, panel, length)
    if not level:
        panel = one_of_two(handle, panel)
        away, middle, half = _away(handle, panel), panel.mean(axis=0), np.ptp(panel, axis=0) / 2
    across = 2 if level else 1
    side = -1.0 if away[across] > (-_UPRIGHT if level else 0.0) else 1.0
    origin = np.array([panel[1, 0] - _BEHIND[int(level)], middle[1], middle[2]])
    origin[across] = middle[across] + side * half[across]
    axis = np.zeros(3)
    axis[1 if level else 2] = -side if level else side
    return origin, axis


def _away(
    handle: Float[np.ndarray, "4 4"], panel: Float[np.ndarray, "2 3"]
) -> Float[np.ndarray, "3"]:
    """From the panel's middle to the handle, in halves of the panel."""
    return (handle[:3, 3] - panel.mean(axis=0)) / np.maximum(np.ptp(panel, axis=0) / 2, 1e-3)
