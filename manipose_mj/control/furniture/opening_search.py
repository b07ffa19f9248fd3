"""How far a known part stands open, from a cloud: the opening at which its looks fit what is seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from manipose_mj.control.furniture.shapes.furniture_model import PartModel
from manipose_mj.poses import transform

_FAR = 0.02  # a point further off counts as this far [m]
_STEPS = {"slide": (0.01, 0.002), "hinge": (0.06, 0.01)}  # of the search, coarse and fine
_BEYOND = {"slide": 0.04, "hinge": 0.5}  # openings beyond the usual that are looked at
_WITHIN = {"slide": 0.12, "hinge": 0.5}  # from where the hand has left it
_BETTER = 0.85  # of the misfit that is left, for another opening to replace the present one
_FITS = 0.003  # misfit up to which a part that nobody touched is where it was [m]
# Misfit of the best near where it should be, from which on it is looked for elsewhere, and up to which it is there [m].
_ASTRAY, _FITS_ELSEWHERE = 0.006, 0.004
_SHUT = {"slide": 0.006, "hinge": 0.03}  # openings below count as shut
_THICKNESSES = (
    0.010,
    0.014,
    0.018,
    0.025,
)  # of a panel, whose other side may be all that shows [m]
_SEEN = 0.75  # share of the points that has to be seen at best: some are hidden
_HIDDEN = (
    0.5  # a point that nobody can see counts as so far, as a share of what is far: it tells nothing
)
_MOST, _FEWEST_LOOKS = 300, 20
# Openings of doors below this are measured by how far points are before the front [rad]; how far from a panel's edges, and
# before the front, they are looked for [m]; from which share of the longest lever on; how many there have to be, and which
# share of what is seen there.
_NEARLY_SHUT, _MARGIN, _FAR_FROM_HINGE, _TELLING, _MOST_SEEN = 0.2, 0.02, 0.5, 100, 0.5
# How far the middle of a hand is from the bar that it holds, at most [m].
_IN_HAND = 0.03


Hidden = Callable[[Float[np.ndarray, "n 3"]], Bool[np.ndarray, "n"]]


def found_opening(
    part: PartModel,
    points: Float[np.ndarray, "n 3"],
    hidden: Hidden | None = None,
    before: float | None = None,
    *,
    tree: cKDTree | None = None,
    touched: bool = True,
) -> float:
    """The opening [m or rad] near the present one that fits best; the present one where none is clearly better.

    Where none fits near it, one that fits well is taken anywhere.

    A door that stands wide open hardly shows; what it shut then looks much like it, shut. And what the arm hides tells
    nothing: a door behind it is not gone.

    Args:
      part: With its looks.
      points: Of the furniture now, object frame [m].
      hidden: Which points, object frame [m], no camera can see for what is in front of them; None: nobody knows.
      before: An opening that the part had before somebody tried to move it to the present one: it may be anywhere in
        between.
      tree: Of the points, where several parts are looked for among them.
      touched: Whether the hand held or pushed it. What it did not is where it was, if it fits there.
    """
    if len(part.looks) < _FEWEST_LOOKS or len(points) < 50:
        return part.opening
    tree = cKDTree(points) if tree is None else tree
    misfit = cache(_misfits(part, tree, hidden))
    if not touched and misfit(part.opening) < _FITS:
        return part.opening
    kind = part.part.joint.kind
    coarse, fine = _STEPS[kind]
    ends = [part.opening, part.opening if before is None else before]
    least = max(min(ends) - _WITHIN[kind], 0.0)
    most = min(part.part.joint.range[1] + _BEYOND[kind], max(ends) + _WITHIN[kind])

    def search(low: float, high: float) -> float:
        tried = [*np.arange(low, high, coarse).tolist(), part.opening]
        best = min(tried, key=misfit)
        near = np.arange(max(best - coarse, 0.0), best + coarse + fine / 2, fine).tolist()
        return min([best, *near], key=misfit)

    best = search(least, most)
    if misfit(best) > _ASTRAY:
        # The arm may have swept it anywhere on its way.
        elsewhere = search(0.0, most)
        best = elsewhere if misfit(elsewhere) < _FITS_ELSEWHERE else best
    measures: list[Callable[[float], float]] = [misfit]
    if kind == "hinge":
        # What stands still by a hinge may be taken for the door: what moves most has to agree.
        measures.append(_misfits(replace(part, looks=_moving_most(part)), tree, hidden))
    for each in measures:
        if each(best) > _BETTER * each(part.opening):
            best = part.opening
    if kind == "hinge" and best < _NEARLY_SHUT:
        tilt = _tilt(part, points)
        best = best if tilt is None else tilt
    return 0.0 if best < _SHUT[kind] else float(best)


def as_held(part: PartModel, place: Float[np.ndarray, "3"]) -> PartModel:
    """The part as far open as the hand holds its handle: as it was seen, if the handle is in the hand then.

    Args:
      part: With its handle.
      place: Of the tool center point, object frame [m].
    """
    handle = part.part.handle
    if handle is None:
        return part
    half = np.array([handle.extents[0] / 2, 0.0, 0.0])
    bar = transform(handle.pose, np.array([-half, half]))

    def away(opening: float) -> float:
        one, other = transform(part.motion(opening), bar)
        along = other - one
        share = np.clip((place - one) @ along / max(along @ along, 1e-12), 0.0, 1.0)
        return float(np.linalg.norm(one + share * along - place))

    if away(part.opening) < _IN_HAND:
        return part
    joint = part.part.joint
    best = min(np.arange(0.0, joint.range[1], _STEPS[joint.kind][1]).tolist(), key=away)
    return part.at(best) if away(best) < _IN_HAND else part


def misfit(
    part: PartModel, points: Float[np.ndarray, "n 3"], hidden: Hidden | None = None
) -> float:
    """How far the looks of a part, as it stands, are from what is seen [m]; arguments as of `found_opening`."""
    return _misfits(part, cKDTree(points), hidden)(part.opening)


def _misfits(part: PartModel, tree: cKDTree, hidden: Hidden | None) -> Callable[[float], float]:
    """The misfit at any opening."""
    looks, kind = part.looks[:_MOST], part.part.joint.kind
    # A door that stands wide open turns its other side to the cameras; a drawer never does.
    sides = [looks]
    if kind == "hinge":
        sides += [looks - [thickness, 0.0, 0.0] for thickness in _THICKNESSES]

    def off(place: Float[np.ndarray, "n 3"]) -> float:
        distances = np.minimum(tree.query(place, distance_upper_bound=_FAR)[0], _FAR)
        if hidden is not None:
            distances = np.where(hidden(place), np.minimum(distances, _HIDDEN * _FAR), distances)
        nearest = np.sort(distances)
        return float(nearest[: max(int(_SEEN * len(nearest)), 1)].mean())

    return lambda opening: min(off(transform(part.motion(opening), side)) for side in sides)


def _moving_most(part: PartModel) -> Float[np.ndarray, "n 3"]:
    """The looks that are far from a hinge's axis."""
    joint, looks = part.part.joint, part.looks
    lever = np.linalg.norm(np.cross(joint.axis, looks - joint.origin), axis=1)
    far = looks[lever > _FAR_FROM_HINGE * lever.max()]
    return far if len(far) >= _FEWEST_LOOKS else looks


def _tilt(part: PartModel, points: Float[np.ndarray, "n 3"]) -> float | None:
    """How far a door that is nearly shut stands open, by how far each point of it is before its front [rad].

    None where too little of what is seen there is before the front.
    """
    low, high = part.panel
    behind = ((points > low + _MARGIN) & (points < high - _MARGIN))[:, 1:].all(axis=1)
    joint = part.part.joint
    # By how much a point goes outwards for a small turn; those far from the hinge tell most.
    lever = np.cross(joint.axis, points - joint.origin)[:, 0]
    behind &= lever > _FAR_FROM_HINGE * lever[behind].max(initial=0.0)
    out = points[:, 0] - high[0]
    on = behind & (out > -_MARGIN) & (out < _NEARLY_SHUT * lever + _MARGIN)
    if on.sum() < max(_TELLING, _MOST_SEEN * behind.sum()):
        return None
    return max(float(np.median(out[on] / lever[on])), 0.0)
