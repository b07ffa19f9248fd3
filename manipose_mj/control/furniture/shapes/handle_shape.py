"""How long, wide and deep a handle is, from the points that stand out of its panel."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.furniture.shapes.boxes import Boxes
from manipose_mj.poses import SymmetryGroup, invert, transform

# Rotations of a level and of an upright bar, X along the bar and Y out of the front.
ACROSS_FRONT = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
UP_FRONT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
_HANDLE_REACH = 0.012  # how far points of a bar are from its axis, across [m]
# Of a handle's lengths, to keep clear of: round ones fill no box, and fingers close on them.
_SOLID = np.array([1.0, 0.8, 0.7])
_TURNS = SymmetryGroup(np.stack([np.eye(3), np.diag([-1.0, 1.0, -1.0])]))
_USUAL_HEIGHT = 0.03  # of a handle before its panel [m]
_FACES = 0.9  # cosine between a handle's Y and the way out of the front, at least
_THIN_BAR, _USUAL_DEPTH = 0.010, 0.012  # how deep bars are at least, and are kept clear of [m]
_STRIP = 0.002  # of a bar, along it [m]
_STRAY = 0.15  # of the points of a usual strip, up to which others are stray
_RARE = 0.08  # share of a bar's points that counts as noise, on either side
# Where points are beside a bar, from its axis [m]; from which share of the bar's own density on it is none.
_BESIDE, _AS_DENSE = (0.030, 0.055), 0.5
_LONG = 0.2  # of a bar, from which on stray points join it to no other [m]
_HALF_BAR = 0.6  # how far along a handle its points are looked for, either way [m]
_STANDING = 0.012  # how far points of a handle are before its panel [m]


def handle_label(
    points: Float[np.ndarray, "n 3"], handle: Float[np.ndarray, "4 4"], front: float
) -> tuple[PoseLabel, bool]:
    """A handle with its lengths, as far as points show it, and whether they do.

    Args:
      points: Of the furniture, object frame, its part shut [m].
      handle: `T_object_handle` as it was estimated.
      front: Of the panel, along X [m].
    """
    label, seen = _measured(points, handle, front)
    if seen:
        # A knob that was estimated beside itself shows in full from its own middle.
        label, seen = _measured(points, label.pose, front)
    return label, seen


def _measured(
    points: Float[np.ndarray, "n 3"], handle: Float[np.ndarray, "4 4"], front: float
) -> tuple[PoseLabel, bool]:
    """As `handle_label`, from points around where the handle was estimated."""
    if handle[0, 3] < front + _STANDING:
        handle = handle.copy()
        handle[0, 3] = front + _USUAL_HEIGHT
    local = transform(invert(handle), points)
    panel = (front - handle[0, 3]) * float(handle[0, 1])  # along the handle's Y [m]
    standing = local[:, 1] > min(panel + _STANDING, -0.006)
    near = standing & (local[:, 1] < 0.03) & (np.abs(local[:, 0]) < _HALF_BAR)
    on = near & (np.abs(local[:, 2]) < 2 * _HANDLE_REACH)
    if on.sum() < 12 or _goes_on(local[near], local[on]):
        usual = np.array([0.10, 0.012, 0.012])
        return PoseLabel(handle[:3, 3], handle[:3, :3], "handle", usual, _TURNS), False
    along = run_around(_often(local[on, 0]), 0.025)
    if along[1] - along[0] > _LONG:
        # One camera sees its far end, with few points, and several its near one, with many.
        along = run_around(local[on, 0], 0.025)
    on &= (local[:, 0] >= along[0]) & (local[:, 0] <= along[1])
    length = max(along[1] - along[0], 0.012)
    sides = _sides(local[on, 2])
    across = float(np.ptp(sides))
    front_side = float(np.percentile(local[on, 1], 85))
    middle = handle[:3, 3] + handle[:3, 2] * float(sides.mean())
    middle = middle + handle[:3, 0] * (along[0] + along[1]) / 2
    if length > 0.045:
        # A bar's rear does not show: it is taken to be as deep as it is wide, if there is room for that.
        depth = float(np.clip(across, _THIN_BAR, max((front_side - panel) / 2, _THIN_BAR)))
        middle = middle + handle[:3, 1] * (front_side - depth / 2)
        depth = max(depth, _USUAL_DEPTH)
    else:
        depth = max(front_side - panel, 0.015)
        middle = middle + handle[:3, 1] * (front_side + panel) / 2
    extents = np.array([length, depth, float(np.clip(across, 0.010, 0.030))])
    rotation = handle[:3, :3]
    if length <= 0.045:
        # A knob: as wide one way as the other, down to the panel; how it is turned about the way out says nothing.
        side = float(np.clip(max(length, across), 0.014, 0.045))
        extents = np.array([side, depth, side])
        rotation = ACROSS_FRONT if handle[0, 1] > _FACES else rotation
    return PoseLabel(middle, rotation, "handle", extents, _TURNS), True


def _goes_on(near: Float[np.ndarray, "n 3"], on: Float[np.ndarray, "m 3"]) -> bool:
    """Whether what stands out of a panel does so on both sides of a bar too: it is a bulge, or another front."""
    low, high = run_around(on[:, 0], _BESIDE[1] - _BESIDE[0])
    near = near[(near[:, 0] >= low) & (near[:, 0] <= high)]
    dense = len(on) / (4 * _HANDLE_REACH)
    sides = [
        ((sign * near[:, 2] > _BESIDE[0]) & (sign * near[:, 2] < _BESIDE[1])).sum()
        for sign in (-1, 1)
    ]
    return min(sides) / (_BESIDE[1] - _BESIDE[0]) > _AS_DENSE * dense


def _often(along: Float[np.ndarray, "n"]) -> Float[np.ndarray, "m"]:
    """Of places along a bar, those where there are many: a stray point joins two knobs that are side by side."""
    _, number, counts = np.unique(
        np.floor(along / (2 * _STRIP)), return_inverse=True, return_counts=True
    )
    return along[counts[number] > _STRAY * np.median(counts)]


def _sides(across: Float[np.ndarray, "n"]) -> Float[np.ndarray, "2"]:
    """Where a bar ends across, from where its points are there [m].

    Of the bar, its front shows, and often a side, with more points than the front: each strip along the bar counts at most
    as much as the median of them. Neighbouring surfaces bleed into outlines: what is rare counts as noise.
    """
    _, number, counts = np.unique(
        np.floor(across / _STRIP), return_inverse=True, return_counts=True
    )
    most = np.median(counts[counts > 1]) if (counts > 1).any() else 1.0
    order = np.argsort(across)
    share = np.cumsum(np.minimum(most / counts, 1.0)[number][order])
    return across[order][np.searchsorted(share, np.array([_RARE, 1 - _RARE]) * share[-1])]


def run_around(along: Float[np.ndarray, "n"], gap: float) -> tuple[float, float]:
    """The run of values around the one nearest to 0 without a gap [m]."""
    values = np.sort(along)
    low = high = float(values[np.abs(values).argmin()])
    for value in values[values > high]:
        if value - high > gap:
            break
        high = float(value)
    for value in values[values < low][::-1]:
        if low - value > gap:
            break
        low = float(value)
    return low, high


def handle_boxes(handle: PoseLabel, front: float) -> Boxes:
    """The bar, and what carries it at both ends; a knob is one box. Object frame."""
    # Handles are along an axis of the front, or nearly so: boxes around them.
    turn = np.abs(handle.rotation)
    half = turn @ (handle.extents * _SOLID) / 2
    boxes = [np.stack([handle.origin - half, handle.origin + half])]
    if handle.extents[0] > 0.045:
        post = turn @ (np.array([0.012, 0.0, handle.extents[2]]) / 2)
        for sign in (1.0, -1.0):
            end = handle.origin + sign * handle.rotation[:, 0] * (handle.extents[0] / 2 - 0.006)
            low, high = end - post, end + post
            low[0], high[0] = front, handle.origin[0]
            boxes.append(np.stack([low, high]))
    else:
        across = np.abs(boxes[0][1, 1:] - boxes[0][0, 1:]).min() / 2
        boxes[0][:, 1:] = handle.origin[1:] + np.array([[-across], [across]])
        boxes[0][0, 0] = min(boxes[0][0, 0], front)
    return np.stack(boxes)


def this_side_up(
    turn: Float[np.ndarray, "3 3"], sensed: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "3 3"]:
    """A bar's rotation, or the one half a turn about its Y further, which is nearer to the sensed: cup pulls open downwards."""
    return max(turn, turn * [-1.0, 1.0, -1.0], key=lambda each: float((each * sensed).sum()))


def along_axes(rotation: Float[np.ndarray, "3 3"], least: float) -> Float[np.ndarray, "3 3"]:
    """A handle's rotation along the axes of the body, where that is nearly so: by this cosine or more."""
    nearest = np.round(rotation)
    if abs(np.linalg.det(nearest) - 1) < 1e-6 and (rotation * nearest).sum(axis=0).min() > least:
        return nearest
    return rotation
