"""Synthetic furniture, only to train on: wardrobes, dressers, cupboards with flaps, desks, large appliances.

The catalogue's furniture is for a table and for an arm. This is what stands beside it in a flat: up to 2.1 m tall and 2.3 m
wide, divided at random, with handles of all sizes anywhere along the free edges. No object of a data set is
copied; sizes are those of sold furniture, roughly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.procedural.articulated.cabinets.carcass import carcass
from asset_pipeline.procedural.articulated.cabinets.sizes import Cabinet
from asset_pipeline.procedural.solids import box
from asset_pipeline.procedural.specimen import specimen_rng
from asset_pipeline.procedural.synthetic_furniture.layout import (
    STYLES,
    FurnitureStyle,
    random_layout,
)
from asset_pipeline.procedural.synthetic_furniture.parts import (
    FurniturePart,
    Side,
    door,
    drawer,
    plain_front,
    surface,
)
from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup

_SEED = "home"  # another word would draw other furniture than estimators were trained on
# As of the catalogue's: X up, Y out of the front, which is towards -x.
_ROTATION = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
_WITHOUT_HANDLE = 0.06  # share of the doors


@dataclass(frozen=True)
class SyntheticFurniture:
    """A piece of furniture, everything shut, in the object frame: z up, the front towards -x.

    Attributes:
      label: Of the whole: X up, Y out of the front.
      base: What stays where it is, fronts without a handle included.
      surroundings: What stands around it, of boxes that may overlap; None: nothing does.
      surfaces: What is seen of each part.
      parts: Of these, in the same order, joint and handle; shut at 0.
    """

    label: PoseLabel
    base: trimesh.Trimesh
    surroundings: trimesh.Trimesh | None
    surfaces: tuple[trimesh.Trimesh, ...]
    parts: tuple[MovingPart, ...]


@dataclass(frozen=True)
class _Fronts:
    """What is before a carcass. Attributes: parts, with handles; plain, fronts without one."""

    parts: list[FurniturePart]
    plain: list[Shape]


def synthetic_furniture(index: int) -> SyntheticFurniture:
    """Piece of furniture `index`: the same on every machine and in every process."""
    rng = specimen_rng(_SEED, index)
    style = STYLES[index % len(STYLES)]
    cabinet = _cabinet(style, rng)
    fronts = _fronts(cabinet, style, rng)
    shapes = [*carcass(cabinet).visual, *fronts.plain, *_clutter(cabinet, rng)]
    shift = np.zeros(3)
    if style.desk:
        more, shift = _desk(cabinet, rng)
    else:
        more = _neighbours(cabinet, rng) if rng.random() < 0.25 else []
    base = _lifted(surface(shapes), shift)
    surroundings = _lifted(surface(more), shift) if more else None
    surfaces = tuple(_lifted(part.surface, shift) for part in fronts.parts)
    seen = [base, *surfaces] if surroundings is None else [base, surroundings, *surfaces]
    bounds = np.array([mesh.bounds for mesh in seen])
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    label = PoseLabel(
        origin=(low + high) / 2,
        rotation=_ROTATION,
        object_type="articulated",
        extents=np.abs(_ROTATION.T @ (high - low)),
        symmetry=SymmetryGroup.identity(),
    )
    parts = tuple(_lifted_part(part.moving, shift) for part in fronts.parts)
    return SyntheticFurniture(label, base, surroundings, surfaces, parts)


def _cabinet(style: FurnitureStyle, rng: np.random.Generator) -> Cabinet:
    depth = rng.uniform(*style.depth)
    inner = depth - rng.uniform(0.03, 0.08)
    feet = style.feet and rng.random() < 0.4
    return Cabinet(
        random_layout(style, rng),
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


def _fronts(c: Cabinet, style: FurnitureStyle, rng: np.random.Generator) -> _Fronts:
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
    """Boxes on the top and on the floors of cells."""
    found = []
    x, y, top = c.depth / 2, c.width / 2, c.height + c.crown
    for _ in range(int(rng.integers(0, 4)) if rng.random() < 0.4 else 0):
        found.append(_random_box((-x, -y, top), (x, y), 0.4, rng))
    for cell in c.layout.cells:
        if cell.kind == "drawer" or rng.random() < 0.6:
            continue
        (right, left), (low, high) = c.across.clear(cell.columns), c.upward.clear(cell.rows)
        found.append(
            _random_box((-x + 0.04, right, low), (x - c.board, left), 0.8 * (high - low), rng)
        )
    return found


def _random_box(
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
    held = []
    for at, inwards in ((ends[0] + 0.02, 1.0), (ends[1] - 0.02, -1.0)):
        if not lift and abs(at) < y:
            continue
        low_y, high_y = sorted((at, at + inwards * (0.025 if panel else size)))
        if panel:
            held.append(box((front + 0.02, low_y, -lift), (back - 0.02, high_y, top)))
            continue
        for low_x in (front + 0.02, back - 0.02 - size):
            held.append(box((low_x, low_y, -lift), (low_x + size, high_y, top)))
    return [board, *held], np.array([0.0, 0.0, lift])


def _lifted(mesh: trimesh.Trimesh, shift: Float[np.ndarray, "3"]) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices + shift, mesh.faces, process=False)


def _lifted_part(part: MovingPart, shift: Float[np.ndarray, "3"]) -> MovingPart:
    assert part.handle is not None
    return replace(
        part,
        joint=replace(part.joint, origin=part.joint.origin + shift),
        handle=replace(part.handle, origin=part.handle.origin + shift),
    )
