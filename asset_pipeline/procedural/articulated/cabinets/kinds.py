"""The kinds of cabinets: how each is divided, and between which sizes it is drawn.

Drawers and doors are named for their places: `bottom_drawer`, `left_door`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from asset_pipeline.procedural.articulated.cabinets.layout import Cell, Layout
from asset_pipeline.procedural.articulated.cabinets.sizes import Cabinet
from asset_pipeline.procedural.specimen import uniform

DRAWERS = ("bottom_drawer", "middle_drawer", "top_drawer")
CHESTS = {
    2: ("bottom_drawer", "top_drawer"),
    3: DRAWERS,
    4: ("bottom_drawer", "lower_drawer", "upper_drawer", "top_drawer"),
    5: ("bottom_drawer", "lower_drawer", "middle_drawer", "upper_drawer", "top_drawer"),
}
BEHIND = 0.060  # of the carcass's depth, what a drawer's inside lacks [m]
STAYS_IN = 0.020  # of a drawer's inside, when it is open [m]

Rng = np.random.Generator


def beside_a_door(columns: tuple[float, float], rows: tuple[float, ...]) -> Layout:
    """Three drawers on the right, a door on the left."""
    cells = _stack(DRAWERS, (0, 1))
    return Layout(columns, rows, (*cells, Cell("door", "door", (1, 2), (0, 3), "left")))


def _stack(names: tuple[str, ...], columns: tuple[int, int], first: int = 0) -> tuple[Cell, ...]:
    """Drawers one above the other."""
    return tuple(
        Cell(name, "drawer", columns, (first + k, first + k + 1)) for k, name in enumerate(names)
    )


def _classic(rng: Rng) -> Cabinet:
    """As index 0; every drawer takes a lying chips can."""
    clear = (uniform(rng, 0.396, 0.420) - 4 * 0.012) / 3
    columns = uniform(rng, 0.321, 0.366), uniform(rng, 0.218, 0.268)
    return Cabinet(
        beside_a_door(columns, (clear,) * 3),
        wall_height=uniform(rng, 0.050, 0.060),
        inner_depth=uniform(rng, 0.335, 0.345),
        travel=uniform(rng, 0.315, 0.325),
    )


def _mirrored(rng: Rng) -> Cabinet:
    """The door on the right."""
    rows = (uniform(rng, 0.112, 0.150),) * 3
    columns = uniform(rng, 0.22, 0.28), uniform(rng, 0.30, 0.38)
    door = Cell("door", "door", (0, 1), (0, 3), "right", shelves=int(rng.integers(0, 2)))
    return _sized(rng, Layout(columns, rows, (*_stack(DRAWERS, (1, 2)), door)), 0.38, 0.44)


def _chest(count: int, width: tuple[float, float], clear: tuple[float, float]) -> Callable:
    """Drawers one above the other, of clear heights in a range; upper ones may be lower."""

    def sized(rng: Rng) -> Cabinet:
        step = uniform(rng, 0.0, 0.06)
        height = uniform(rng, *clear)
        rows = tuple(height * (1 - step * k) for k in range(count))
        layout = Layout((uniform(rng, *width),), rows, _stack(CHESTS[count], (0, 1)))
        return _sized(rng, layout, 0.36, 0.48)

    return sized


def _two_doors(rng: Rng) -> Cabinet:
    """A cupboard with two doors over one space."""
    door = Cell("door", "double door", (0, 1), (0, 1), shelves=int(rng.integers(1, 3)))
    height = uniform(rng, 0.46, 0.76)
    layout = Layout((uniform(rng, 0.50, 0.78),), (height,), (door,))
    return _sized(rng, layout, 0.30, 0.38, doors=("frame", "glass", "slab"))


def _wall_cupboard(rng: Rng) -> Cabinet:
    """One door, its handle low."""
    side = "left" if rng.random() < 0.5 else "right"
    shelves = int(rng.integers(1, 3))
    door = Cell("door", "door", (0, 1), (0, 1), side, shelves=shelves, handle_at=0.25)
    layout = Layout((uniform(rng, 0.30, 0.46),), (uniform(rng, 0.42, 0.66),), (door,))
    return _sized(rng, layout, 0.30, 0.38, doors=("glass", "frame", "slab"), feet=False)


def _night_stand(rng: Rng) -> Cabinet:
    """A drawer above a door."""
    side = "left" if rng.random() < 0.5 else "right"
    rows = uniform(rng, 0.27, 0.40), uniform(rng, 0.11, 0.15)
    door = Cell("door", "door", (0, 1), (0, 1), side, handle_at=0.7)
    layout = Layout((uniform(rng, 0.34, 0.46),), rows, (door, *_stack(("drawer",), (0, 1), 1)))
    return _sized(rng, layout, 0.36, 0.42, doors=("frame", "slab"))


def _drawer_over_two_doors(rng: Rng) -> Cabinet:
    """A wide drawer above a double door."""
    rows = uniform(rng, 0.34, 0.52), uniform(rng, 0.12, 0.16)
    door = Cell("door", "double door", (0, 1), (0, 1), shelves=1, handle_at=0.7)
    layout = Layout((uniform(rng, 0.48, 0.70),), rows, (door, *_stack(("drawer",), (0, 1), 1)))
    return _sized(rng, layout, 0.36, 0.44, doors=("frame", "slab", "glass"))


def _two_and_two(rng: Rng) -> Cabinet:
    """Two drawers side by side above two doors."""
    rows = uniform(rng, 0.30, 0.46), uniform(rng, 0.11, 0.15)
    clear = uniform(rng, 0.27, 0.37)
    cells = (
        Cell("right_door", "door", (0, 1), (0, 1), "right", shelves=1, handle_at=0.65),
        Cell("left_door", "door", (1, 2), (0, 1), "left", shelves=1, handle_at=0.65),
        *_stack(("right_drawer",), (0, 1), 1),
        *_stack(("left_drawer",), (1, 2), 1),
    )
    return _sized(rng, Layout((clear, clear), rows, cells), 0.36, 0.44, doors=("frame", "slab"))


def _sideboard(rng: Rng) -> Cabinet:
    """Three drawers between two doors."""
    rows = (uniform(rng, 0.118, 0.170),) * 3
    side = uniform(rng, 0.21, 0.25)
    cells = (
        Cell("right_door", "door", (0, 1), (0, 3), "right", shelves=1),
        Cell("left_door", "door", (2, 3), (0, 3), "left", shelves=1),
        *_stack(DRAWERS, (1, 2)),
    )
    layout = Layout((side, uniform(rng, 0.28, 0.33), side), rows, cells)
    return _sized(rng, layout, 0.36, 0.44, doors=("slab", "frame"))


def _desk_unit(rng: Rng) -> Cabinet:
    """A tall door below, with two drawers above."""
    rows = (
        uniform(rng, 0.26, 0.34),
        uniform(rng, 0.10, 0.13),
        uniform(rng, 0.10, 0.13),
    )
    side = "left" if rng.random() < 0.5 else "right"
    cells = (
        Cell("door", "door", (0, 1), (0, 1), side, handle_at=0.75),
        *_stack(("lower_drawer", "upper_drawer"), (0, 1), 1),
    )
    return _sized(rng, Layout((uniform(rng, 0.28, 0.40),), rows, cells), 0.40, 0.48)


def _sized(
    rng: Rng,
    layout: Layout,
    least: float,
    most: float,
    *,
    doors: tuple = ("slab",),
    feet: bool = True,
) -> Cabinet:
    """The layout at a depth in a range [m], with drawers as deep as fit, and feet and top at random."""
    depth = uniform(rng, least, most)
    inner = depth - BEHIND
    lowest = min(layout.rows)
    leaves = [_leaf_width(layout, cell) for cell in layout.cells if cell.kind != "drawer"]
    return Cabinet(
        layout,
        depth=depth,
        board=uniform(rng, 0.012, 0.018),
        front=uniform(rng, 0.014, 0.019),
        wall_height=round(min(lowest - 0.040, uniform(rng, 0.4, 0.7) * lowest), 4),
        inner_depth=inner,
        travel=inner - STAYS_IN,
        feet=uniform(rng, 0.03, 0.10) if feet and rng.random() < 0.5 else 0.0,
        crown=uniform(rng, 0.016, 0.022) if feet and rng.random() < 0.5 else 0.0,
        style=doors[int(rng.integers(len(doors)))],
        # So that a hand that pulls at the free edge feels the same whatever the width.
        door_damping=round(0.3 * (max(leaves, default=0.25) / 0.25) ** 2, 3),
    )


def _leaf_width(layout: Layout, cell: Cell) -> float:
    """Of a door, nearly [m]."""
    return sum(layout.columns[slice(*cell.columns)]) / (2 if cell.kind == "double door" else 1)


KINDS: tuple[Callable[[Rng], Cabinet], ...] = (
    _classic,
    _chest(2, (0.32, 0.44), (0.13, 0.20)),
    _two_doors,
    _classic,
    _mirrored,
    _chest(4, (0.30, 0.44), (0.11, 0.16)),
    _night_stand,
    _wall_cupboard,
    _chest(3, (0.34, 0.56), (0.12, 0.19)),
    _drawer_over_two_doors,
    _chest(5, (0.30, 0.44), (0.105, 0.135)),
    _two_and_two,
    _sideboard,
    _desk_unit,
)
