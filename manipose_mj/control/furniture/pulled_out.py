"""Drawers that stand open: the front that stands out of the body, where no handle was found or the hand has led it out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.fit.furniture_fit import cavity_behind
from manipose_mj.control.furniture.other_kind import as_drawer
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.control.furniture.shapes.handle_shape import (
    ACROSS_FRONT,
    handle_boxes,
    handle_label,
)
from manipose_mj.poses import compose, invert, transform

_FACING = 0.75  # cosine between normals of a drawer's front and X, at least
# How far such a front stands out of the body: handles stand out less, nothing slides further [m].
_LEAST_OUT, _MOST_OUT = 0.06, 0.60
_PLANE = 0.012  # how far points of a front are from its plane [m]
_BIN = 0.004  # in which they are counted [m]
_LEAST, _SMALLEST = 200, 0.05  # points of a front; its sides [m]
_THICKNESS = 0.018  # [m]
_HANDLE = 0.03  # of a handle before its front [m]
_LOOKS = 500
# Of a drawer that was led out: how far at least, by how much less or more it may be than was felt, a step of the search, how
# near a point is that shows one of its looks [m]; how many of these have to have come along, which share may have stayed; the
# panel beyond what came along [m].
_LED_OUT, _SLIPPED, _BEYOND, _STEP, _SHOWS = 0.06, 0.12, 0.03, 0.003, 0.006
_CAME, _STAYED, _RIM = 40, 0.1, 0.005


def pulled_out(model: FurnitureModel, cloud: SceneCloud, name: str) -> FurnitureModel | None:
    """The model with a drawer of that name where a front stands out of the body; None where none does.

    What had the name is kept under another.

    Args:
      model: With its parts, which all look shut.
      cloud: Of the furniture, with normals.
      name: Of the drawer.
    """
    points = transform(invert(model.pose), cloud.points)
    out = cloud.normals @ model.pose[:3, 0] > _FACING
    front = model.front
    low, high = model.solid[:, 0].min(axis=0) - 0.03, model.solid[:, 1].max(axis=0) + 0.03
    out &= (points[:, 0] > front + _LEAST_OUT) & (points[:, 0] < front + _MOST_OUT)
    out &= ((points > low) & (points < high))[:, 1:].all(axis=1)
    if out.sum() < _LEAST:
        return None
    edges = np.arange(front + _LEAST_OUT, front + _MOST_OUT + 2 * _BIN, _BIN)
    counts = np.convolve(np.histogram(points[out, 0], edges)[0], np.ones(3), mode="same")
    place = edges[int(counts.argmax())] + _BIN / 2
    on = out & (np.abs(points[:, 0] - place) < _PLANE)
    ends = np.percentile(points[on, 1:], [1, 99], axis=0)
    if on.sum() < _LEAST or (np.ptp(ends, axis=0) < _SMALLEST).any():
        return None
    opening = float(np.median(points[on, 0])) - front
    shut = points - [opening, 0.0, 0.0]
    panel = np.column_stack([[front - _THICKNESS, front], ends])
    middle = np.array([front + _HANDLE, *ends.mean(axis=0)])
    handle, _ = handle_label(shut, compose(ACROSS_FRONT, middle), front)
    rows = np.random.default_rng(0).permutation(np.flatnonzero(on))[:_LOOKS]
    joint = Joint("slide", handle.origin, np.array([1.0, 0.0, 0.0]), (0.0, 1.0))
    part = PartModel(
        part=MovingPart(name, joint, handle, None),
        panel=panel,
        handle=handle_boxes(handle, front),
        opening=0.0,
        confidence=1.0,
        looks=shut[rows],
    )
    drawer = as_drawer(part)
    joint = drawer.part.joint
    joint = replace(joint, range=(0.0, max(joint.range[1], opening)))
    drawer = replace(drawer, part=replace(drawer.part, joint=joint), opening=opening)
    return model.with_another(drawer)


def as_it_moved(part: PartModel, points: Float[np.ndarray, "n 3"]) -> PartModel:
    """A drawer without what stayed behind as the hand led it out: that was never its front.

    The same where little stayed behind, or where hardly anything came along: the hand may have slipped off.

    Args:
      part: At the opening that the hand has led it to.
      points: Of the furniture now, object frame [m].
    """
    if part.hinged or part.opening < _LED_OUT:
        return part
    tree, axis = cKDTree(points), part.part.joint.axis
    openings = np.arange(max(part.opening - _SLIPPED, _LED_OUT), part.opening + _BEYOND, _STEP)
    shown = [tree.query(part.looks + o * axis, distance_upper_bound=_SHOWS)[0] for o in openings]
    best = int(np.argmax([np.isfinite(each).sum() for each in shown]))
    came = np.isfinite(shown[best])
    stayed = (tree.query(part.looks)[0] < _SHOWS) & ~came
    if came.sum() < _CAME or stayed.sum() < _STAYED * len(part.looks):
        return part
    low, high = np.percentile(part.looks[came], [2, 98], axis=0)
    panel = part.panel.copy()
    panel[0, 1:] = np.maximum(panel[0, 1:], low[1:] - _RIM)
    panel[1, 1:] = np.minimum(panel[1, 1:], high[1:] + _RIM)
    cavity = cavity_behind(panel, "slide", part.part.joint.range[1], 0.0)
    part = replace(part, panel=panel, looks=part.looks[came], opening=float(openings[best]))
    return replace(part, part=replace(part.part, cavity=cavity))
