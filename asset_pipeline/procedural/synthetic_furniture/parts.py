"""Drawers, doors and flaps of synthetic furniture: what is seen of each, and its joint and handle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.procedural.articulated.cabinets.front_panel import Pane, framed, slab
from asset_pipeline.procedural.articulated.cabinets.layout import Cell
from asset_pipeline.procedural.articulated.cabinets.sizes import WOOD, Cabinet
from asset_pipeline.procedural.articulated.handles.knob import Knob
from asset_pipeline.procedural.articulated.handles.mounted import Direction, Mounted
from asset_pipeline.procedural.solids import box
from asset_pipeline.procedural.synthetic_furniture.handles import random_handle
from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint, Shape

Span = tuple[float, float]  # [m]
Side = Literal["left", "right", "top", "bottom"]
_FRAMED_FROM = 0.17  # lower fronts than this are slabs [m]
_MARGIN = 0.015  # between a handle and the edge of its front [m]
# Opening about these turns the free edge towards -x.
_AXES: dict[Side, tuple[float, float, float]] = {
    "left": (0.0, 0.0, -1.0),
    "right": (0.0, 0.0, 1.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
}


@dataclass(frozen=True)
class FurniturePart:
    """A part with its handle, shut, in the frame of the cabinet.

    Attributes:
      surface: What is seen of it.
      moving: Its joint, which is shut at 0, and its handle.
    """

    surface: trimesh.Trimesh
    moving: MovingPart


def surface(shapes: Sequence[Shape]) -> trimesh.Trimesh:
    """What is seen of shapes, as one mesh."""
    surfaces = [shape.surface(16) for shape in shapes]
    bare = [trimesh.Trimesh(m.vertices, m.faces) for m in surfaces]
    return cast(trimesh.Trimesh, trimesh.util.concatenate(bare))


def drawer(c: Cabinet, cell: Cell, rng: np.random.Generator) -> FurniturePart:
    """A drawer behind the front of a cell."""
    y, z = c.across.cover(cell.columns, c.gap), c.upward.cover(cell.rows, c.gap)
    (right, left), (low, _) = c.across.clear(cell.columns), c.upward.clear(cell.rows)
    floor, back = low + c.gap + c.wall, c.face + c.inner_depth
    top = floor + rng.uniform(0.3, 0.8) * (z[1] - floor)
    outer = right + c.gap, left - c.gap
    inner = outer[0] + c.wall, outer[1] - c.wall
    tray = [
        box((c.face, outer[0], low + c.gap), (back + c.wall, outer[1], floor)),
        box((c.face, outer[0], floor), (back + c.wall, inner[0], top)),
        box((c.face, inner[1], floor), (back + c.wall, outer[1], top)),
        box((back, inner[0], floor), (back + c.wall, inner[1], top)),
    ]
    style = c.style if z[1] - z[0] >= _FRAMED_FROM and c.style == "frame" else "slab"
    panel, recess = _front(c, y, z, style)
    direction: Direction = "upright" if rng.random() < 0.05 else "level"
    room = y if direction == "level" else z
    handle = random_handle(rng, room[1] - room[0] - 2 * _MARGIN)
    if isinstance(handle, Knob):
        direction = "level"  # nothing else would tell
    # In the middle across; often higher.
    height = 0.5 if rng.random() < 0.6 else rng.uniform(0.3, 0.85)
    along = handle.length / 2 if direction == "upright" else 0.02
    at = _within(z[0] + height * (z[1] - z[0]), z, along + _MARGIN)
    foot = np.array([c.face - c.front + recess, (y[0] + y[1]) / 2, at])
    mounted = handle.mounted(foot, direction)
    axis, origin = np.array([-1.0, 0.0, 0.0]), np.array([c.face, foot[1], low])
    return _part(cell.name, [*panel, *tray], mounted, axis, origin, c.travel, hinge=False)


def door(
    c: Cabinet,
    name: str,
    side: Side,
    y: Span,
    z: Span,
    handle_at: float,
    rng: np.random.Generator,
) -> FurniturePart:
    """A door or a flap over a part of the front.

    Args:
      c: Whose front it is.
      name: Of the part.
      side: Where it is hinged, as seen from the front.
      y, z: What it covers; y grows to the left [m].
      handle_at: Where the handle is along the free edge, from 0 to 1.
      rng: Draws the handle and how far it opens.
    """
    panel, _ = _front(c, y, z, c.style)
    upright = side in ("left", "right")
    across, along = (y, z) if upright else (z, y)
    direction: Direction = "upright" if upright == (rng.random() < 0.9) else "level"
    room = z if direction == "upright" else y
    handle = random_handle(rng, min(0.8 * (room[1] - room[0]), room[1] - room[0] - 2 * _MARGIN))
    if isinstance(handle, Knob):
        direction = "upright" if upright else "level"  # nothing else would tell
    rim = handle.length / 2 if (direction == "upright") != upright else 0.015
    off = max(rng.uniform(0.02, 0.09), rim + _MARGIN / 2)
    off = min(off, 0.5 * (across[1] - across[0]))
    at_low = side in ("left", "top")  # the free edge, along y or z
    free = across[0] + off if at_low else across[1] - off
    reach = handle.length / 2 if (direction == "upright") == upright else 0.02
    middle = _within(along[0] + handle_at * (along[1] - along[0]), along, reach + _MARGIN)
    foot = np.array([c.face - c.front, *((free, middle) if upright else (middle, free))])
    hinge = across[1] if at_low else across[0]
    # Anywhere in the door's thickness: no view of a shut door tells.
    origin = np.array([c.face - rng.uniform() * c.front, 0.0, 0.0])
    origin[1 if upright else 2] = hinge
    travel = rng.uniform(np.pi / 2, np.pi if rng.random() < 0.3 else 2.2)
    mounted = handle.mounted(foot, direction)
    shapes = [*panel, *_decor(c, y, z, mounted, rng)]
    return _part(name, shapes, mounted, np.array(_AXES[side]), origin, travel, hinge=True)


def plain_front(c: Cabinet, y: Span, z: Span) -> list[Shape]:
    """A front without a handle."""
    return list(_front(c, y, z, c.style)[0])


def _part(
    name: str,
    shapes: Sequence[Shape],
    mounted: Mounted,
    axis: Float[np.ndarray, "3"],
    origin: Float[np.ndarray, "3"],
    travel: float,
    *,
    hinge: bool,
) -> FurniturePart:
    joint = Joint("hinge" if hinge else "slide", origin, axis, (0.0, travel))
    return FurniturePart(
        surface([*shapes, *mounted.portion.visual]),
        MovingPart(name, joint, handle=mounted.label, cavity=None),
    )


def _front(c: Cabinet, y: Span, z: Span, style: str) -> tuple[tuple[Shape, ...], float]:
    """The panel, and how far its middle lies behind its outer side [m]."""
    low, high = np.array([c.face - c.front, y[0], z[0]]), np.array([c.face, y[1], z[1]])
    if style == "slab" or min(y[1] - y[0], z[1] - z[0]) < 3 * c.rail:
        return slab(low, high, rgba=c.front_rgba, density=WOOD).visual, 0.0
    inset = min(0.008, c.front / 2)
    pane = Pane(inset, c.front - inset, c.front_rgba, WOOD)
    panel = framed(
        low, high, (c.rail, c.rail, c.rail, c.rail), pane, rgba=c.front_rgba, density=WOOD
    )
    return panel.visual, inset


def _decor(c: Cabinet, y: Span, z: Span, mounted: Mounted, rng: np.random.Generator) -> list[Shape]:
    """Flat plates on some fronts, clear of the handle and no higher: no handles, though they stand out."""
    if rng.random() < 0.8:
        return []
    found, label = [], mounted.label
    reach = np.abs(label.rotation @ label.extents)[1:] / 2 + 0.04
    for _ in range(int(rng.integers(1, 4))):
        size = rng.uniform([0.02, 0.02], [0.6 * (y[1] - y[0]), 0.6 * (z[1] - z[0])])
        low = rng.uniform([y[0], z[0]], np.array([y[1], z[1]]) - size)
        if np.all(np.abs(low + size / 2 - label.origin[1:]) < size / 2 + reach):
            continue
        face = c.face - c.front
        thick = rng.uniform(0.002, max(0.002, min(0.015, face - label.origin[0])))
        found.append(box((face - thick, *low), (face, *(low + size))))
    return found


def _within(at: float, span: Span, margin: float) -> float:
    """As near to `at` as the margin to both ends allows."""
    if span[1] - span[0] < 2 * margin:
        return (span[0] + span[1]) / 2
    return float(np.clip(at, span[0] + margin, span[1] - margin))
