"""What a label looks like when it is drawn: lines, planes and boxes in the object frame.

X is red, Y green, Z blue; joint axes are cyan; areas of grip are yellow, functional ones magenta.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Area, Asset, MovingPart
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import compose, rotation_angle, transform

Colour = tuple[float, float, float]
RED, GREEN, BLUE = (0.90, 0.10, 0.10), (0.10, 0.70, 0.15), (0.12, 0.25, 0.95)
CYAN, YELLOW, MAGENTA = (0.0, 0.80, 0.90), (0.95, 0.75, 0.10), (0.85, 0.15, 0.75)
# An axis reaches beyond the box by this share of its longest side.
BEYOND = 0.12
TOOL_AXES = 0.3
PLANE_MARGIN = 1.15


@dataclass(frozen=True)
class Line:
    """From `start` to `end`, `(3,)` each, in the object frame with joints at zero [m].

    Attributes: body, the moving part that carries it, or None for the base.
    """

    start: Float[np.ndarray, "3"]
    end: Float[np.ndarray, "3"]
    colour: Colour
    body: str | None = None


@dataclass(frozen=True)
class Box:
    """Pose `T_object_box` and full lengths [m] along its axes; a plane has one of no length."""

    pose: Float[np.ndarray, "4 4"]
    extents: Float[np.ndarray, "3"]
    colour: Colour


def label_lines(asset: Asset) -> tuple[Line, ...]:
    """Axes of the label and of handles, and axes of joints."""
    lines = list(axes(asset.label))
    size = float(asset.label.extents.max())
    for part in asset.parts:
        lines += part_lines(part, size)
    return tuple(lines)


def axes(label: PoseLabel, body: str | None = None) -> tuple[Line, ...]:
    """X, Y and Z from the label's origin to outside the bounding box, if that is in its middle."""
    beyond = BEYOND * float(label.extents.max())
    lengths = np.maximum(label.extents / 2, beyond) + beyond
    if label.object_type == "functional":
        lengths = np.full(3, TOOL_AXES * float(label.extents.max()))  # the origin is near one end
    elif label.object_type == "handle":
        lengths = np.maximum(lengths, 0.5 * lengths.max())  # a bar is thin
    ends = transform(label.pose, np.diag(lengths))
    return tuple(
        Line(label.origin, end, colour, body)
        for end, colour in zip(ends, (RED, GREEN, BLUE), strict=True)
    )


def part_lines(part: MovingPart, size: float) -> tuple[Line, ...]:
    """Axes of the handle, and the joint's for two fifths of the length of an object of this size.

    A slide has a direction and no place of its own: its axis is drawn through the handle.
    """
    joint, handle = part.joint, part.handle
    slides = joint.kind == "slide"
    middle = joint.origin if handle is None or not slides else handle.origin
    reach = 0.2 * size * joint.axis
    line = Line(middle - reach, middle + reach, CYAN, part.name if slides else None)
    return (line, *(() if handle is None else axes(handle, part.name)))


def symmetry_planes(label: PoseLabel) -> tuple[Box, ...]:
    """The mirror planes that the conventions give a label of its type and group, as thin boxes.

    One plane is XY; XZ comes with half a turn about X, and YZ with half a turn about Y as well. Tools and
    solids of revolution have planes that their label does not single out: none are shown.
    """
    if label.object_type != "mirror":
        return ()
    normals = [2]
    for axis, normal in ((0, 1), (1, 0)):
        half = np.diag(np.where(np.arange(3) == axis, 1.0, -1.0))
        if min(rotation_angle(turn, half) for turn in label.symmetry.rotations) < 1e-2:
            normals.append(normal)
        else:
            break
    colours = (RED, GREEN, BLUE)
    boxes = []
    for normal in normals:
        extents = PLANE_MARGIN * label.extents
        extents[normal] = 0.0
        boxes.append(Box(label.pose, extents, colours[normal]))
    return tuple(boxes)


def area_boxes(areas: tuple[Area, ...], label: PoseLabel) -> tuple[Box, ...]:
    """Where the object is held and where it does its work."""
    return tuple(
        Box(
            label.pose @ compose(np.eye(3), area.center),
            area.extents,
            YELLOW if area.use == "grip" else MAGENTA,
        )
        for area in areas
    )
