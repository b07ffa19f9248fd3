"""Furniture for the home, only to train on: wardrobes, dressers, cupboards with flaps, desks, large appliances.

The catalogue's furniture is for a table and for an arm. This is what stands beside it in a flat: up to 2.1 m tall and 2.3 m
wide, divided at random, with handles of all sizes anywhere along the free edges. No object of a data set is
copied; sizes are those of sold furniture, roughly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from asset_pipeline.geometry import Shape
from asset_pipeline.labelling.label import PoseLabel
from asset_pipeline.procedural.articulated.cabinet_sizes import Cabinet
from asset_pipeline.procedural.articulated.carcass import carcass
from asset_pipeline.procedural.solids import box
from asset_pipeline.procedural.specimen import specimen_rng
from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.articulated_subject import ArticulatedSubject
from manipose_mj.ppf_jax.home_layout import STYLES, HomeStyle, home_layout
from manipose_mj.ppf_jax.home_parts import HomePart, Side, door, drawer, plain_front, triangles
from manipose_mj.ppf_jax.rasteriser import Triangles

CATEGORY = "home"
# As of the catalogue's: X up, Y out of the front, which is towards -x.
_ROTATION = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
_WITHOUT_HANDLE = 0.06  # share of the doors


@dataclass(frozen=True)
class _Fronts:
    """What is before a carcass. Attributes: parts, with handles; plain, fronts without one."""

    parts: list[HomePart]
    plain: list[Shape]


def home_furniture(index: int) -> ArticulatedSubject:
    """Piece of furniture `index`: the same on every machine and in every process."""
    rng = specimen_rng(CATEGORY, index)
    style = STYLES[index % len(STYLES)]
    cabinet = _cabinet(style, rng)
    fronts = _fronts(cabinet, style, rng)
    shapes = [*carcass(cabinet).visual, *fronts.plain, *_clutter(cabinet, rng)]
    shift = np.zeros(3)
    if style.desk:
        more, shift = _desk(cabinet, rng)
    else:
        more = _neighbours(cabinet, rng) if rng.random() < 0.25 else []
    base = triangles(shapes)
    if more:
        base = Triangles(np.concatenate([base.corners, triangles(more).corners]), False)
    base = Triangles(base.corners + shift, base.closed)
    parts = [_shifted(part, shift) for part in fronts.parts]
    corners = np.concatenate([base.corners, *(part.surface.corners for part in parts)])
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    label = PoseLabel(
        origin=(low + high) / 2,
        rotation=_ROTATION,
        object_type="articulated",
        extents=np.abs(_ROTATION.T @ (high - low)),
        symmetry=SymmetryGroup.identity(),
    )
    return ArticulatedSubject(
        name=f"{CATEGORY}_{index:03d}",
        category=CATEGORY,
        label=label,
        base=base,
        parts=tuple(part.surface for part in parts),
        joints=tuple(part.joint for part in parts),
        hull=_box_corners(base),
    )


def _cabinet(style: HomeStyle, rng: np.random.Generator) -> Cabinet:
    depth = rng.uniform(*style.depth)
    inner = depth - rng.uniform(0.03, 0.08)
    feet = style.feet and rng.random() < 0.4
    return Cabinet(
        home_layout(style, rng),
        depth=depth,
        board=rng.uniform(0.012, 0.030),
        front=rng.uniform(*style.front),
        gap=rng.uniform(0.002, 0.005),
        inner_depth=inner,
        travel=inner * rng.uniform(0.6, 0.95),
        feet=rng.uniform(0.02, 0.18) if feet else 0.0,
        crown=rng.uniform(0.01, 0.04) if rng.random() < 0.3 else 0.0,
        overhang=rng.uniform(0.0, 0.04),
        style="frame" if rng.random() < 0.35 else "slab",
        rail=rng.uniform(0.03, 0.08),
    )


def _fronts(c: Cabinet, style: HomeStyle, rng: np.random.Generator) -> _Fronts:
    found = _Fronts([], [])
    # One habit for the whole, now and then something else.
    low = float(rng.uniform(0.1, 0.9))
    for cell in c.layout.cells:
        if cell.kind == "drawer":
            found.parts.append(drawer(c, cell, rng))
            continue
        y, z = c.across.cover(cell.columns, c.gap), c.upward.cover(cell.rows, c.gap)
        leaves: list[tuple[str, Side, tuple[float, float]]] = [(cell.name, cell.hinge, y)]
        if cell.kind == "double door":
            middle = (y[0] + y[1]) / 2
            leaves = [
                (f"right_{cell.name}", "right", (y[0], middle - c.gap / 2)),
                (f"left_{cell.name}", "left", (middle + c.gap / 2, y[1])),
            ]
        elif rng.random() < style.flaps:
            leaves = [(cell.name, "top" if rng.random() < style.upwards else "bottom", y)]
        at = low if rng.random() < 0.7 else float(rng.uniform(0.05, 0.95))
        for name, side, span in leaves:
            if found.parts and rng.random() < _WITHOUT_HANDLE:
                found.plain.extend(plain_front(c, span, z))
                continue
            along = at if side in ("left", "right") or rng.random() < 0.2 else 0.5
            found.parts.append(door(c, name, side, span, z, along, rng))
    return found


def _clutter(c: Cabinet, rng: np.random.Generator) -> list[Shape]:
    """Things on the top and on the floors of cells."""
    found = []
    x, y, top = c.depth / 2, c.width / 2, c.height + c.crown
    for _ in range(int(rng.integers(0, 4)) if rng.random() < 0.4 else 0):
        found.append(_thing((-x, -y, top), (x, y), 0.4, rng))
    for cell in c.layout.cells:
        if cell.kind == "drawer" or rng.random() < 0.6:
            continue
        (right, left), (low, high) = c.across.clear(cell.columns), c.upward.clear(cell.rows)
        found.append(_thing((-x + 0.04, right, low), (x - c.board, left), 0.8 * (high - low), rng))
    return found


def _thing(
    low: Sequence[float], high: Sequence[float], tallest: float, rng: np.random.Generator
) -> Shape:
    """A box somewhere on a rectangle at a height; `low` (x, y, z) and `high` (x, y) [m]."""
    room = np.asarray(high) - low[:2]
    size = rng.uniform(0.15, 0.6, 2) * np.minimum(room, 0.5)
    corner = np.asarray(low[:2]) + rng.uniform(0.0, 1.0, 2) * (room - size)
    height = rng.uniform(0.05, max(tallest, 0.06))
    return box((*corner, low[2]), (*(corner + size), low[2] + height))


def _neighbours(c: Cabinet, rng: np.random.Generator) -> list[Shape]:
    """A plain piece beside the cabinet, or an open one on it."""
    x, y, top = c.depth / 2, c.width / 2, c.height + c.crown
    if rng.random() < 0.6:
        side = rng.choice([-1.0, 1.0])
        near, far = side * (y + rng.uniform(0.0, 0.02)), side * (y + rng.uniform(0.2, 0.7))
        height = c.height * rng.uniform(0.4, 1.1)
        front = -x - rng.choice([0.0, c.front])
        return [box((front, min(near, far), 0.0), (x, max(near, far), height))]
    depth, height, t = rng.uniform(0.15, 0.3), rng.uniform(0.25, 0.6), c.board
    back = x - depth
    return [
        box((back, -y, top), (x, -y + t, top + height)),
        box((back, y - t, top), (x, y, top + height)),
        box((back, -y, top + height), (x, y, top + height + t)),
        box((x - t, -y + t, top), (x, y - t, top + height)),
        box((back, -y + t, top + height / 2), (x - t, y - t, top + height / 2 + t)),
    ]


def _desk(c: Cabinet, rng: np.random.Generator) -> tuple[list[Shape], np.ndarray]:
    """A table top over the cabinet and beyond it with what carries it; and by how much all is lifted [m]."""
    x, y, top = c.depth / 2, c.width / 2, c.height
    lift = rng.uniform(0.05, 0.45) if rng.random() < 0.5 else 0.0
    reach = rng.uniform(0.4, 1.3)
    ends = [-y - 0.02, y + 0.02]
    if lift and rng.random() < 0.4:
        ends = [-y - reach / 2, y + reach / 2]
    else:
        side = int(rng.integers(2))
        ends[side] += (-1.0 if side == 0 else 1.0) * reach
    front, back = -x - c.front - rng.uniform(0.0, 0.15), x + rng.uniform(0.0, 0.15)
    thick = rng.uniform(0.018, 0.05)
    board = box((front, ends[0], top), (back, ends[1], top + thick))
    size = rng.uniform(0.03, 0.07)
    panel = rng.random() < 0.4
    carried = []
    for at, inwards in ((ends[0] + 0.02, 1.0), (ends[1] - 0.02, -1.0)):
        if not lift and abs(at) < y:
            continue
        low_y, high_y = sorted((at, at + inwards * (0.025 if panel else size)))
        if panel:
            carried.append(box((front + 0.02, low_y, -lift), (back - 0.02, high_y, top)))
            continue
        for low_x in (front + 0.02, back - 0.02 - size):
            carried.append(box((low_x, low_y, -lift), (low_x + size, high_y, top)))
    return [board, *carried], np.array([0.0, 0.0, lift])


def _shifted(part: HomePart, shift: np.ndarray) -> HomePart:
    handle = part.joint.handle.copy()
    handle[:3, 3] += shift
    moved = replace(part.joint, origin=part.joint.origin + shift, handle=handle)
    return HomePart(Triangles(part.surface.corners + shift, part.surface.closed), moved)


def _box_corners(surface: Triangles) -> np.ndarray:
    """`(8, 3)` [m]: the hull is only asked how far it reaches."""
    low, high = surface.corners.min(axis=(0, 1)), surface.corners.max(axis=(0, 1))
    grid = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0]), axis=-1).reshape(-1, 3)
    return low + grid * (high - low)
