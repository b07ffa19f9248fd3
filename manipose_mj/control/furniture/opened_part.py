"""What is seen of a part once it is open: how large its panel is, and the cavity that it gives access to."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import Cavity
from manipose_mj.control.furniture.cavity_rim import seen_rim, tallest_compartment
from manipose_mj.control.furniture.seen_through import Past, widened
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.boxes import voxel_boxes
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.poses import invert, transform

# Open so far, a part shows what is behind it [m, rad].
_TELLING = {"slide": 0.10, "hinge": 0.7}
_PLANE = 0.010  # how far points of a panel are from its plane [m]
# Of a door from its front, backwards and forwards [m]; share of a door's sides that has to show to tell them.
_DOOR_PLANE, _MOST_OF_DOOR = (0.05, 0.02), 0.7
_RARE = 5.0  # percentage of the points of its inside that may be further out
_AT_HINGE = 0.04  # a side that is no further from the hinge is the hinge's [m]
_BEYOND = 0.08  # by how much a panel may be larger than was guessed [m]
_FLAT, _FACING = 0.8, 0.75  # cosines of normals to an axis
_LEAST = 25  # points that tell a side
_BIN = 0.005  # [m]
_SIDE_MARGIN = 0.004  # kept off sides that were measured [m]
_UNSEEN = 0.02  # and off those that were not, from the panel's edges [m]
_ROOF = 0.015  # below the panel's upper edge [m]
_BEHIND_MOUTH = 0.06  # from where on what faces the front is no frame [m]
_WALL, _WALL_SHARE = (
    0.015,
    0.3,
)  # of points of a rear wall from its plane [m]; of what faces the front
# What is seen on a part that stands open, or is shut: how far off its panel; how far off what is known, and off handles, whose
# shape is not; cells [m], and points that make one count.
_ON_OPEN, _ON_SHUT = np.array([0.12, 0.10, 0.10]), np.array([0.08, 0.0, 0.0])
_KNOWN, _HANDLED = 0.008, 0.03
_EXTRA, _EXTRA_LEAST = 0.025, 6
# How far beyond a panel's edges is looked whether it goes on, in steps [m]; points along an edge, and the share of them that a
# camera looks past where it ends.
_STEP_BEYOND, _STEPS_BEYOND, _SAMPLES, _SEEN_PAST = 0.02, 12, 8, 0.25
_RIM_ROOF = 0.006  # kept off a roof that was measured [m]


def seen_open(
    model: FurnitureModel, part: PartModel, cloud: SceneCloud, past: Past | None = None
) -> PartModel:
    """The part with what its open state shows; as it was where that is nothing.

    Args:
      model: The furniture.
      part: One of it, at its present opening.
      cloud: Of the furniture now, with normals.
      past: Which points, object frame [m], some camera looks past; None: nobody knows.
    """
    kind = part.part.joint.kind
    if part.opening < _TELLING[kind]:
        return part
    to_object = invert(model.pose)
    points = transform(to_object, cloud.points)
    normals = cloud.normals @ model.pose[:3, :3]
    if kind == "slide":
        back = invert(part.motion(part.opening))
        return _drawer(part, transform(back, points), normals)
    return _door(model, part, points, normals, past)


def with_extra(model: FurnitureModel, part: PartModel, cloud: SceneCloud) -> PartModel:
    """A part with boxes of all that is seen on it beyond its panel and handle: what stands out of a front, or an open door's end.

    Args:
      model: The furniture.
      part: One of it, at its present opening.
      cloud: Of the furniture now.
    """
    points = transform(invert(model.pose), cloud.points)
    shut = transform(invert(part.motion(part.opening)), points)
    # Beside what is shut, something else begins.
    around = _ON_OPEN if part.opening > 0.0 else _ON_SHUT
    near = ((shut > part.panel[0] - around) & (shut < part.panel[1] + around)).all(axis=1)
    known = [(box, points, _KNOWN) for box in model.solid]
    for other in model.parts:
        own = other.name == part.name
        place = shut if own else transform(invert(other.motion(other.opening)), points)
        known.append(((part if own else other).panel, place, _KNOWN))
        for box in (part if own else other).handle:
            known.append((box, place, _HANDLED))
    for box, place, margin in known:
        near &= ~((place > box[0] - margin) & (place < box[1] + margin)).all(axis=1)
    return replace(part, extra=voxel_boxes(shut[near], _EXTRA, _EXTRA_LEAST))


def reaching_unseen(
    model: FurnitureModel, part: PartModel, cloud: SceneCloud, past: Past
) -> PartModel:
    """A door that stands open, as large as the hole that it leaves where no camera sees it end.

    Args:
      model: The furniture.
      part: The door, at its present opening.
      cloud: Of the furniture now.
      past: Which points, object frame [m], some camera looks past.
    """
    points = transform(invert(model.pose), cloud.points)
    body = np.array([model.solid[:, 0].min(axis=0), model.solid[:, 1].max(axis=0)])
    panel = part.panel.copy()
    wall = points[(points[:, 0] > panel[0, 0] - _WALL) & (points[:, 0] < panel[1, 0] + _WALL), 1:]
    for axis, end in product((1, 2), (0, 1)):
        if (
            np.abs(panel[end, axis] - part.part.joint.origin[axis]) < _AT_HINGE
            and abs(float(part.part.joint.axis[axis])) < _FACING
        ):
            continue  # the hinge is there
        for _ in range(_STEPS_BEYOND):
            strip = panel.copy()
            strip[1 - end, axis] = panel[end, axis]
            strip[end, axis] += (1 if end else -1) * _STEP_BEYOND
            grid = _spread(strip)
            outside = abs(strip[end, axis] - body[:, axis].mean()) > np.ptp(body[:, axis]) / 2
            if outside or past(transform(part.motion(part.opening), grid)).mean() > _SEEN_PAST:
                break
            on = ((wall > strip[0, 1:]) & (wall < strip[1, 1:])).all(axis=1)
            cells = np.unique(np.floor(wall[on] / _STEP_BEYOND).astype(int), axis=0)
            if len(cells) > _WALL_SHARE * np.prod(np.ptp(strip, axis=0)[1:]) / _STEP_BEYOND**2:
                break
            panel[end, axis] = strip[end, axis]
    return replace(part, panel=panel)


def _spread(box: Float[np.ndarray, "2 3"]) -> Float[np.ndarray, "n 3"]:
    """Points all over the middle of a flat box."""
    shares = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    y, z = (low + shares * (high - low) for low, high in box[:, 1:].T)
    flat = np.stack(np.meshgrid(y, z), axis=-1).reshape(-1, 2)
    return np.column_stack([np.full(len(flat), box[:, 0].mean()), flat])


def _drawer(
    part: PartModel, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
) -> PartModel:
    """From points as they would be were the drawer shut: what stands out of the body is the drawer's."""
    panel = _measured_panel(part, points, normals)
    front, opening = panel[1, 0], part.opening
    # Out of the body now: shut, it would be behind the front by less than the opening.
    inside = (points[:, 0] < front - 0.008) & (points[:, 0] > front - opening + 0.02)
    for axis in (1, 2):
        inside &= (points[:, axis] > panel[0, axis]) & (points[:, axis] < panel[1, axis])
    thickness = 0.018
    back = inside & (normals[:, 0] < -_FACING) & (points[:, 0] > front - 0.05)
    if back.sum() >= _LEAST:
        thickness = float(np.clip(front - np.median(points[back, 0]), 0.008, 0.04))
    floor, left, right = _floor_and_sides(points, normals, inside, panel)
    low = np.array([front - opening, left, floor])
    high = np.array([front - thickness, right, panel[1, 2] - _ROOF])
    panel[0, 0] = front - thickness
    if (high - low < 0.03).any():
        return replace(part, panel=panel)
    cavity = Cavity((low + high) / 2, high - low, moves_with_part=True)
    return replace(part, panel=panel, part=replace(part.part, cavity=cavity), seen_inside=True)


def _door(
    model: FurnitureModel,
    part: PartModel,
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    past: Past | None,
) -> PartModel:
    """From what shows through the opening, and of the door itself."""
    measured = replace(part, panel=_door_panel(part, points, normals))
    low, high = part.panel
    front = high[0]
    inside = points[:, 0] < front - 0.025
    for axis in (1, 2):
        inside &= (points[:, axis] > low[axis] - 0.01) & (points[:, axis] < high[axis] + 0.01)
    inside &= points[:, 0] > model.solid[:, 0, 0].min() + 0.006
    if inside.sum() < 4 * _LEAST:
        return measured
    floor, left, right = _floor_and_sides(points, normals, inside, part.panel)
    rim = seen_rim(points, normals, part.panel)
    left = left if rim.left is None else max(left, rim.left + _SIDE_MARGIN)
    right = right if rim.right is None else min(right, rim.right - _SIDE_MARGIN)
    roof = high[2] - max(_ROOF, 0.02) if rim.roof is None else rim.roof - _RIM_ROOF
    space = tallest_compartment(points, inside, normals, roof)
    if space is not None:
        floor, roof = space.floor + 0.001, space.roof
    mouth = front - 0.018 if rim.mouth is None else rim.mouth
    # The rear: where most points look out of the front, those of the frame around the opening left out.
    behind = inside & (points[:, 0] < mouth - _BEHIND_MOUTH)
    facing = behind & (normals[:, 0] > _FACING)
    rear = float(np.percentile(points[inside, 0], 3))
    if facing.sum() >= _LEAST:
        wall = _mode(points[facing, 0])
        # What faces the front by chance is spread over the whole depth.
        if (np.abs(points[facing, 0] - wall) < _WALL).mean() > _WALL_SHARE:
            rear = wall + 0.004
    hole = np.array([[rear, left, floor], [mouth, right, roof]])
    if (np.ptp(hole, axis=0) < 0.05).any():
        return measured
    if past is not None:
        body = np.array([model.solid[:, 0].min(axis=0), model.solid[:, 1].max(axis=0)])
        hole = widened(hole, body, past)
    cavity = Cavity(hole.mean(axis=0), np.ptp(hole, axis=0), moves_with_part=False)
    return replace(measured, part=replace(part.part, cavity=cavity), seen_inside=True)


def _door_panel(
    part: PartModel, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "2 3"]:
    """Where a door that is open ends, from the points of either side of it, and how thick it is, from those of its inside."""
    back = invert(part.motion(part.opening))
    shut, turned = transform(back, points), normals @ back[:3, :3].T
    low, high = part.panel
    on = (shut[:, 0] > high[0] - _DOOR_PLANE[0]) & (shut[:, 0] < high[0] + _DOOR_PLANE[1])
    on &= np.abs(turned[:, 0]) > _FACING
    on &= ((shut > low - _PLANE) & (shut < high + _PLANE))[:, 1:].all(axis=1)
    if on.sum() < 8 * _LEAST:
        return part.panel
    panel = part.panel.copy()
    inside = shut[on & (turned[:, 0] < 0), 0]
    if len(inside) >= _LEAST:
        panel[0, 0] = min(low[0], float(np.percentile(inside, _RARE)))
    ends = np.percentile(shut[on, 1:], [0.7, 99.3], axis=0)
    if (np.ptp(ends, axis=0) < _MOST_OF_DOOR * (high - low)[1:]).any():
        return panel  # something hides much of it
    # On the side of the hinge the body bleeds into it.
    hinge = np.abs(part.panel[:, 1:] - part.part.joint.origin[1:]) < _AT_HINGE
    across = np.abs(part.part.joint.axis[1:]) < _FACING
    return np.column_stack([panel[:, 0], np.where(hinge & across, panel[:, 1:], ends)])


def _measured_panel(
    part: PartModel, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "2 3"]:
    """The front of a drawer that is open, from the points in its plane."""
    panel = part.panel.copy()
    low, high = panel[0] - _BEYOND, panel[1] + _BEYOND
    on = np.abs(points[:, 0] - panel[1, 0]) < _PLANE
    for axis in (1, 2):
        on &= (points[:, axis] > low[axis]) & (points[:, axis] < high[axis])
    on &= normals[:, 0] > 0.5
    if on.sum() < 4 * _LEAST:
        return panel
    seen = points[on]
    for axis in (1, 2):
        panel[:, axis] = np.percentile(seen[:, axis], [0.7, 99.3])
    # The hand may hide one end: a drawer's handle is in its middle.
    assert part.part.handle is not None
    middle = float(part.part.handle.origin[1])
    half = float(np.abs(panel[:, 1] - middle).max())
    panel[:, 1] = np.clip([middle - half, middle + half], low[1], high[1])
    panel[1, 0] = float(np.median(seen[:, 0]))
    return panel


def _floor_and_sides(
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    inside: Bool[np.ndarray, "n"],
    panel: Float[np.ndarray, "2 3"],
) -> tuple[float, float, float]:
    """Height of the floor, and where left and right sides are along Y [m]."""
    low, high = panel
    level = inside & (normals[:, 2] > _FLAT)
    level &= (points[:, 1] > low[1] + 0.03) & (points[:, 1] < high[1] - 0.03)
    level &= points[:, 2] < (low[2] + 2 * high[2]) / 3
    floor = low[2] + _UNSEEN
    if level.sum() >= _LEAST:
        floor = _mode(points[level, 2]) + 0.001
    walls = inside & (points[:, 2] > floor + 0.015)
    sides = [low[1] + _UNSEEN, high[1] - _UNSEEN]
    for end, sign in ((0, 1.0), (1, -1.0)):
        own = walls & (sign * normals[:, 1] > _FACING)
        own &= np.abs(points[:, 1] - panel[end, 1]) < 0.12
        if own.sum() >= _LEAST:
            sides[end] = _mode(points[own, 1]) + sign * _SIDE_MARGIN
    return floor, float(sides[0]), float(sides[1])


def _mode(values: Float[np.ndarray, "n"]) -> float:
    """Where most values are [m]."""
    edges = np.arange(values.min() - _BIN, values.max() + 2 * _BIN, _BIN)
    counts = np.convolve(np.histogram(values, edges)[0], np.ones(3), mode="same")
    middle = edges[int(counts.argmax())] + _BIN / 2
    return float(np.median(values[np.abs(values - middle) < 2 * _BIN]))
