"""What an appliance is set by: dials, keys, a display with the time. They do not move.

All stand on a face whose outward normal is -x; places on it are y and z [m].
"""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.articulated.cabinets.front_panel import merged, plate_mesh
from asset_pipeline.procedural.articulated.handles.knob import OUTWARDS
from asset_pipeline.procedural.pieces import placed_shape
from asset_pipeline.procedural.revolution import convex_part, fillet, lathe
from asset_pipeline.procedural.solids import PRINT_THICKNESS, box
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import compose

DIAL_CORNERS = 16
GLOW: Colour = (0.25, 0.95, 0.75, 1.0)
# Which of a digit's seven strokes are lit: top, upper right, lower right, bottom, lower left, upper
# left, middle.
_STROKES = (
    "1111110", "0110000", "1101101", "1111001", "0110011",
    "1011011", "1011111", "1110000", "1111111", "1111011",
)  # fmt: skip
Place = tuple[float, float]


def raised(
    face: float,
    at: Place,
    size: Place,
    proud: float,
    *,
    rgba: Colour,
    corner: float = 0.002,
) -> Shape:
    """A plate with rounded corners: a button, a display.

    Args:
      face: Where the face is, along x [m].
      at: Of its middle.
      size: Width and height [m].
      proud: How far it stands off the face [m].
      rgba: Its colour.
      corner: Radius [m].
    """
    middle, half = np.array(at), np.array(size) / 2
    mesh = plate_mesh((face - proud, face), (middle - half, middle + half, corner))
    return Shape("mesh", mesh=mesh, rgba=rgba)


def keys(
    face: float,
    at: Place,
    size: Place,
    grid: tuple[int, int],
    *,
    rgba: Colour,
    proud: float = 0.001,
) -> Shape:
    """Rows and columns of keys that fill an area of this width and height [m]."""
    rows, columns = grid
    pitch = size[0] / columns, size[1] / rows
    meshes = [
        raised(
            face,
            (
                at[0] + (column - (columns - 1) / 2) * pitch[0],
                at[1] + (row - (rows - 1) / 2) * pitch[1],
            ),
            (0.74 * pitch[0], 0.66 * pitch[1]),
            proud,
            rgba=rgba,
        ).surface()
        for row in range(rows)
        for column in range(columns)
    ]
    return merged(meshes, rgba)


def clock(face: float, at: Place, height: float, time: str, *, rgba: Colour) -> Shape:
    """The time in seven strokes a digit, such as `"12:30"`, as seen from the front."""
    width, stroke = 0.55 * height, 0.13 * height
    step = 0.85 * height
    # Strokes as middle and size in a digit of this width and height, seen from the front.
    upper, lower = height / 4, -height / 4
    side = (stroke, 0.40 * height)
    bar = (0.8 * width, stroke)
    shapes: tuple[tuple[Place, Place], ...] = (
        ((0, height / 2), bar), ((width / 2, upper), side), ((width / 2, lower), side),
        ((0, -height / 2), bar), ((-width / 2, lower), side), ((-width / 2, upper), side),
        ((0, 0), bar),
    )  # fmt: skip
    meshes = []
    for k, sign in enumerate(time):
        # To the right, as seen from the front, is towards -y.
        offset = (k - (len(time) - 1) / 2) * step
        dots = (((0.0, upper / 2), (stroke, stroke)), ((0.0, lower / 2), (stroke, stroke)))
        lit = (
            dots
            if sign == ":"
            else [s for s, on in zip(shapes, _STROKES[int(sign)], strict=True) if on == "1"]
        )
        for (right, up), (across, tall) in lit:
            middle = np.array([face, at[0] - offset - right, at[1] + up])
            half = np.array([2 * PRINT_THICKNESS, across / 2, tall / 2])
            meshes.append(box(middle - half, middle + half).surface())
    return merged(meshes, rgba)


def dial(
    face: float, at: Place, radius: float, proud: float, turn: float, *, rgba: Colour, mark: Colour
) -> tuple[list[Shape], list[Shape]]:
    """A knob to turn, with a mark that points `turn` [rad] to the right of up: visuals, and solid."""
    outline = fillet(
        np.array(
            [(0.0, 0.0), (radius, 0.0), (0.92 * radius, proud), (0.0, proud)],
        ),
        {2: 0.12 * radius},
        steps=2,
    )
    pose = compose(OUTWARDS, np.array([face, *at]))
    knob = placed_shape(Shape("mesh", mesh=lathe(outline, 32), rgba=rgba), pose)
    angles = np.arange(DIAL_CORNERS) * (2 * pi / DIAL_CORNERS)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings = [np.column_stack([r * circle, np.full(DIAL_CORNERS, z)])
             for r, z in ((radius, 0.0), (0.92 * radius, proud))]  # fmt: skip
    solid = placed_shape(convex_part(np.concatenate(rings)), pose)
    pointer = _pointer(radius, proud, turn, mark)
    return [knob, placed_shape(pointer, compose(np.eye(3), np.array([face, *at])))], [solid]


def ring_of_marks(face: float, at: Place, radius: float, count: int, *, rgba: Colour) -> Shape:
    """Dots around a dial, all but the lowest sixth."""
    meshes = []
    for angle in np.linspace(-5 * pi / 6, 5 * pi / 6, count):
        middle = np.array([face, at[0] - radius * sin(angle), at[1] + radius * cos(angle)])
        half = np.array([2 * PRINT_THICKNESS, 0.0011, 0.0011])
        meshes.append(box(middle - half, middle + half).surface())
    return merged(meshes, rgba)


def _pointer(radius: float, proud: float, turn: float, rgba: Colour) -> Shape:
    """A stripe on the front of a dial about the origin."""
    stripe: Float[np.ndarray, "3"] = np.array([2 * PRINT_THICKNESS, 0.06 * radius, 0.32 * radius])
    shape = box(-stripe, stripe, rgba)
    # To the right, as seen from the front, is from +z towards -y: about x, anticlockwise.
    rotation = np.array([[1, 0, 0], [0, cos(turn), -sin(turn)], [0, sin(turn), cos(turn)]])
    middle = np.array([-proud, 0.0, 0.0]) + rotation @ np.array([0.0, 0.0, 0.52 * radius])
    return placed_shape(shape, compose(rotation, middle))
