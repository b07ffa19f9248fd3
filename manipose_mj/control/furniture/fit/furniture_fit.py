"""From a cloud of furniture and the parts that were sensed in it to its model in boxes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from typing import Literal

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Cavity, MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.fit.door_hinge import WITH_KNOBS, usual_swing, whole_front
from manipose_mj.control.furniture.fit.handle_claims import claim, missed
from manipose_mj.control.furniture.fit.object_frame import object_pose
from manipose_mj.control.furniture.fit.shut_part import (
    FACING,
    ShutPart,
    between_neighbours,
    panel_place,
)
from manipose_mj.control.furniture.sensing.part_sensing import SensedFurniture
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.body_shape import body_slices, ends_of
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.control.furniture.shapes.handle_shape import handle_boxes, handle_label
from manipose_mj.control.furniture.shapes.relief import relief
from manipose_mj.poses import invert, transform

# How far drawers open in the median of the training furniture: of the depth, [m].
DRAWER_SHARE, TYPICAL_DRAWER = 0.70, 0.32
_PANEL = 0.018  # thickness [m]
_WALL, _DOOR_WALL = 0.022, 0.03  # around cavities that were not seen [m]
_REAR = 0.03  # behind them [m]
# How far points of a panel's plane are from it [m]; points that tell its sides.
_FACE, _FACE_LEAST = 0.012, 150
_FREE_EDGE = 0.05  # of a door, from its handle [m]
_TO_SIDE = 0.09  # a side of the body that is no further from the handle is the door's edge [m]
_ONE_HINGE = 0.04  # hinges nearer than this are one [m]
# How far handles of double doors are apart [m], and how nearly their body shows as wide to both sides.
_TWO_DOORS, _AS_WIDE = (0.03, 0.25), 0.85
_UNSEEN = 0.15  # of its confidence that is left to a handle of which no point shows
_MEET = 0.01  # handles nearer than this are one [m]
_LOOKS = 500


def fit_furniture(cloud: SceneCloud, sensed: SensedFurniture, category: str) -> FurnitureModel:
    """The model of a piece of furniture.

    Args:
      cloud: Of it alone.
      sensed: Its front and parts.
      category: Such as `"cabinet"`.
    """
    pose = object_pose(cloud, sensed)
    points = transform(invert(pose), cloud.points)
    normals = cloud.normals @ pose[:3, :3]
    shut = [ShutPart(part, pose, category in WITH_KNOBS) for part in sensed.parts]
    bounds = _bounds(points, normals, shut)
    for part in shut:
        part.meet_handle(points, normals)
    if category not in WITH_KNOBS:
        front = relief(points, float(bounds[1, 0]))
        claim(shut, front, points)
        shut += [twin for part in shut if (twin := part.twin(shut, points, normals))]
        for part in tuple(shut):
            shut += part.column(shut, points, normals)
        shut += missed(shut, front, points)
    sides = _as_wide_on_both_sides(bounds, shut)
    for part in shut:
        if category not in WITH_KNOBS or part.is_bar:
            part.turn_as_doors_do(shut, sides, points, normals)
        part.hang(points, normals, sides)
    if any(part.opening == 0.0 for part in shut):
        for part in shut:
            part.meet_front(points, normals, float(bounds[1, 0]))
    for part in shut:
        part.meet_swing(points, normals)
        part.meet_panel(points, normals)
    parts = [
        _part(number, part, shut, points, normals, bounds, category)
        for number, part in enumerate(shut)
    ]
    parts = _distinct(parts)
    return FurnitureModel(pose, body_slices(points, bounds), tuple(parts), category)


def _distinct(parts: list[PartModel]) -> list[PartModel]:
    """Of parts whose fitted handles meet, shut or as they stand, or that turn about one hinge, the surest."""
    kept: list[PartModel] = []
    for part in sorted(parts, key=lambda part: -part.confidence):
        if not any(_meet(part, other) or _one_door(part, other) for other in kept):
            kept.append(part)
    return kept


def _meet(part: PartModel, other: PartModel) -> bool:
    """Whether two handles take up one place, both shut or both as they stand."""
    pairs = [(part.handle[0], other.handle[0]), (_handle_now(part), _handle_now(other))]
    return any(
        bool(((mine[0] - _MEET < its[1]) & (mine[1] + _MEET > its[0])).all()) for mine, its in pairs
    )


def _handle_now(part: PartModel) -> Float[np.ndarray, "2 3"]:
    """Low and high corner of a handle's bar as it stands, object frame."""
    corners = np.array(list(product(*part.handle[0].T)))
    moved = transform(part.motion(part.opening), corners)
    return np.stack([moved.min(axis=0), moved.max(axis=0)])


def _one_door(part: PartModel, other: PartModel) -> bool:
    """Whether two parts turn about one hinge, at one height."""
    mine, its = part.part.joint, other.part.joint
    if mine.kind != "hinge" or its.kind != "hinge" or mine.axis @ its.axis < np.cos(0.2):
        return False
    apart = np.cross(mine.origin - its.origin, its.axis)
    overlap = np.minimum(part.panel[1], other.panel[1]) - np.maximum(part.panel[0], other.panel[0])
    return float(np.linalg.norm(apart)) < _ONE_HINGE and bool((overlap[1:] > 0.05).all())


def _bounds(
    points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], shut: Sequence[ShutPart]
) -> Float[np.ndarray, "2 3"]:
    """Low and high corner of the body; its front is where the panels of shut parts are."""
    low, high = ends_of(points)
    fronts = [panel_place(points, normals, part) for part in shut if part.opening == 0.0]
    fronts = [front for front in fronts if front is not None]
    opened = [part for part in shut if part.opening > 0.0]
    if fronts:
        high[0] = float(np.median(fronts))
    if opened:
        front = high[0] if fronts else max(part.handle[0, 3] - 0.035 for part in opened)
        high[0] = front
        body = points[points[:, 0] < front]
        if len(body) > 200:
            low, ends = ends_of(body)
            high[1:] = ends[1:]
    return np.stack([low, high])


def _as_wide_on_both_sides(
    bounds: Float[np.ndarray, "2 3"], shut: Sequence[ShutPart]
) -> Float[np.ndarray, "2 3"]:
    """Bounds of a body whose pictures end before it does on one side: double doors are in its middle."""
    doors = [part for part in shut if part.measured and part.kind == "hinge"]
    for first, second in combinations(doors, 2):
        apart = second.handle[:3, 3] - first.handle[:3, 3]
        if _TWO_DOORS[0] < abs(apart[1]) < _TWO_DOORS[1] and abs(apart[2]) < _MEET:
            middle = float(first.handle[1, 3] + apart[1] / 2)
            ends = np.abs(bounds[:, 1] - middle)
            if ends.min() > _AS_WIDE * ends.max():
                found = bounds.copy()
                found[:, 1] = middle + np.array([-1.0, 1.0]) * ends.max()
                return found
    return bounds


def _part(
    number: int,
    part: ShutPart,
    others: Sequence[ShutPart],
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    bounds: Float[np.ndarray, "2 3"],
    category: str,
) -> PartModel:
    """One part: its panel is what is nearer to its handle than to those of others."""
    moved = transform(part.back, points)
    turned = normals @ part.back[:3, :3].T
    front = panel_place(moved, turned, part)
    if front is None:
        front = float(bounds[1, 0])
    panel = _panel(part, others, bounds, front)
    panel = _within_face(panel, moved[turned[:, 0] > FACING], part)
    low, high = panel
    on = ((moved > low - 0.006) & (moved < high + 0.006)).all(axis=1)
    base = front if part.base is None else part.base
    handle, seen = handle_label(moved, part.handle, base)
    held = np.abs(transform(invert(handle.pose), moved)) < handle.extents / 2 + 0.006
    rows = np.flatnonzero(on | held.all(axis=1))
    rows = np.random.default_rng(number).permutation(rows)[:_LOOKS]
    depth = float(bounds[1, 0] - bounds[0, 0])
    joint = Joint(part.kind, part.origin, part.axis, (0.0, _range(part, depth, category)))
    name = f"part_{number}"
    cavity = cavity_behind(panel, part.kind, joint.range[1], float(bounds[0, 0]))
    return PartModel(
        part=MovingPart(name, joint, handle, cavity),
        panel=panel,
        handle=handle_boxes(handle, base),
        opening=part.opening,
        confidence=part.sensed.confidence * (1.0 if seen or part.sensed.certain else _UNSEEN),
        looks=moved[rows],
    )


def _range(part: ShutPart, depth: float, category: str) -> float:
    """How far the part may open [m or rad]: as is usual."""
    if part.kind == "slide":
        # The rear of what is deep, or stands at an angle, is out of all cameras' sight.
        return max(DRAWER_SHARE * depth, TYPICAL_DRAWER, part.opening)
    return max(usual_swing(part.axis, category), part.opening)


def _panel(
    part: ShutPart, others: Sequence[ShutPart], bounds: Float[np.ndarray, "2 3"], front: float
) -> Float[np.ndarray, "2 3"]:
    """The rectangle between the handles of neighbours, the hinge and the body's sides."""
    low, high = between_neighbours(part, others, bounds)
    own, half = part.handle[:3, 3], part.half
    if part.kind == "hinge":
        axis = 1 if abs(part.axis[2]) > 0.7 else 2
        if part.origin[axis] > own[axis]:
            high[axis] = part.origin[axis] + 0.006
            edge = own[axis] - half[axis] - _FREE_EDGE
            low[axis] = low[axis] if own[axis] - low[axis] < _TO_SIDE else max(edge, low[axis])
        else:
            low[axis] = part.origin[axis] - 0.006
            edge = own[axis] + half[axis] + _FREE_EDGE
            high[axis] = high[axis] if high[axis] - own[axis] < _TO_SIDE else min(edge, high[axis])
    low[0], high[0] = front - _PANEL, front
    return np.stack([low, high])


def _within_face(
    panel: Float[np.ndarray, "2 3"], points: Float[np.ndarray, "n 3"], part: ShutPart
) -> Float[np.ndarray, "2 3"]:
    """As much of a panel as its plane has points for: below there may be a plinth, behind the front."""
    on = np.abs(points[:, 0] - panel[1, 0]) < _FACE
    on &= ((points > panel[0] - 0.01) & (points < panel[1] + 0.01))[:, 1:].all(axis=1)
    if on.sum() < _FACE_LEAST:
        return panel
    low, high = ends_of(points[on])
    whole = whole_front(points, float(panel[1, 0]), part.handle, panel, _FACE)
    low, high = np.maximum(low, whole[0]), np.minimum(high, whole[1])
    found = panel.copy()
    own, half = part.handle[:3, 3], part.half
    for axis in (1, 2):
        found[0, axis] = min(max(panel[0, axis], low[axis] - 0.005), own[axis] - half[axis])
        found[1, axis] = max(min(panel[1, axis], high[axis] + 0.005), own[axis] + half[axis])
    return found


def cavity_behind(
    panel: Float[np.ndarray, "2 3"], kind: Literal["slide", "hinge"], most: float, rear: float
) -> Cavity | None:
    """What may be behind a panel: a guess until it is open.

    Args:
      panel: Low and high corner, object frame [m].
      kind: Of the part's joint.
      most: How far a part that slides opens [m].
      rear: Of the furniture, along X [m].
    """
    slides = kind == "slide"
    wall = np.array([0.0, 1.0, 1.0]) * (_WALL if slides else _DOOR_WALL)
    low, high = panel[0] + wall, panel[1] - wall
    high[0] = panel[0, 0]
    low[0] = high[0] - most if slides else rear + _REAR
    if (high - low < 0.04).any():
        return None
    return Cavity((low + high) / 2, high - low, moves_with_part=slides)
