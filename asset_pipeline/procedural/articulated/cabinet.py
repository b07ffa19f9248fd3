"""Cabinets: chests of drawers, cupboards and what combines them, that stand on a table or on the floor.

Real sizes. Sold desk-top drawer cabinets are 250-400 mm deep and 300-450 mm tall, of boards of
12-18 mm; drawer units for desks 280-360 mm wide and 690-700 mm tall (IKEA's HELMER is 28 x 43 x 69 cm,
ALEX 36 x 58 x 70), night stands 370-460 mm wide and 450-700 mm tall (KULLEN 35 x 40 x 49, TARVA
48 x 39 x 62), kitchen wall cupboards 300-600 mm wide and 370-390 mm deep (METOD), cupboards with two
doors 800 x 300 x 830 mm (IVAR); none here is taller or wider than 0.90 m, what an arm of 0.85 m can
serve. Bar handles stand 30-40 mm off the front. The drawers run on full-extension slides, so that a drawer
comes out by nearly its own depth; they shut by the slides' friction.

Index 0 is a column of three drawers and, beside it, a column behind a door on the +y side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from asset_pipeline.procedural.articulated.bar_handle import BarHandle
from asset_pipeline.procedural.articulated.bow_handle import BowHandle
from asset_pipeline.procedural.articulated.edge_pull import EdgePull
from asset_pipeline.procedural.articulated.furniture import Cabinet, furniture
from asset_pipeline.procedural.articulated.knob import Knob
from asset_pipeline.procedural.articulated.layout import Cell, Layout
from asset_pipeline.procedural.articulated.mounted import Handle
from asset_pipeline.procedural.specimen import Colour, Specimen, drawn, in_turn, specimen_rng

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
# Carcass, fronts, inside, handles.
_COLOURS: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    ((0.93, 0.92, 0.90, 1), (0.80, 0.84, 0.86, 1), (0.95, 0.94, 0.92, 1), (0.20, 0.20, 0.21, 1)),
    ((0.50, 0.34, 0.22, 1), (0.58, 0.40, 0.26, 1), (0.70, 0.55, 0.39, 1), (0.72, 0.58, 0.30, 1)),
    ((0.85, 0.76, 0.62, 1), (0.42, 0.55, 0.48, 1), (0.90, 0.84, 0.73, 1), (0.17, 0.16, 0.15, 1)),
    ((0.78, 0.62, 0.43, 1), (0.90, 0.88, 0.83, 1), (0.86, 0.75, 0.58, 1), (0.25, 0.23, 0.22, 1)),
    ((0.88, 0.78, 0.60, 1), (0.30, 0.38, 0.50, 1), (0.92, 0.85, 0.72, 1), (0.75, 0.76, 0.77, 1)),
    ((0.95, 0.95, 0.94, 1), (0.97, 0.97, 0.96, 1), (0.93, 0.93, 0.92, 1), (0.66, 0.67, 0.69, 1)),
    ((0.28, 0.28, 0.30, 1), (0.34, 0.34, 0.36, 1), (0.55, 0.54, 0.53, 1), (0.78, 0.64, 0.36, 1)),
    ((0.67, 0.47, 0.29, 1), (0.72, 0.52, 0.33, 1), (0.82, 0.68, 0.49, 1), (0.14, 0.13, 0.12, 1)),
    ((0.72, 0.16, 0.15, 1), (0.78, 0.20, 0.18, 1), (0.86, 0.84, 0.82, 1), (0.80, 0.80, 0.81, 1)),
)


def design(index: int) -> Cabinet:
    """The sizes of instance `index`."""
    if index == 0:
        return Cabinet(_beside_a_door((0.356, 0.248), (0.124,) * 3))
    rng = specimen_rng("cabinet", index)
    wood, front, inside, metal = in_turn(index, _COLOURS)
    plain = _KINDS[index % len(_KINDS)](rng)
    return replace(
        plain,
        drawer_friction=drawn(rng, 1.5, 3.0),
        drawer_damping=drawn(rng, 5.0, 10.0),
        handle=_PULLS[index % len(_PULLS)](rng, metal),
        wood=wood,
        front_rgba=front,
        inside=inside,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, everything shut."""
    return furniture(design(index))


def _beside_a_door(columns: tuple[float, float], rows: tuple[float, ...]) -> Layout:
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
    clear = (drawn(rng, 0.396, 0.420) - 4 * 0.012) / 3
    columns = drawn(rng, 0.321, 0.366), drawn(rng, 0.218, 0.268)
    return Cabinet(
        _beside_a_door(columns, (clear,) * 3),
        wall_height=drawn(rng, 0.050, 0.060),
        inner_depth=drawn(rng, 0.335, 0.345),
        travel=drawn(rng, 0.315, 0.325),
    )


def _mirrored(rng: Rng) -> Cabinet:
    """The door on the right."""
    rows = (drawn(rng, 0.112, 0.150),) * 3
    columns = drawn(rng, 0.22, 0.28), drawn(rng, 0.30, 0.38)
    door = Cell("door", "door", (0, 1), (0, 3), "right", shelves=int(rng.integers(0, 2)))
    return _sized(rng, Layout(columns, rows, (*_stack(DRAWERS, (1, 2)), door)), 0.38, 0.44)


def _chest(count: int, width: tuple[float, float], clear: tuple[float, float]) -> Callable:
    """Drawers one above the other, of clear heights in a range; upper ones may be lower."""

    def sized(rng: Rng) -> Cabinet:
        step = drawn(rng, 0.0, 0.06)
        height = drawn(rng, *clear)
        rows = tuple(height * (1 - step * k) for k in range(count))
        layout = Layout((drawn(rng, *width),), rows, _stack(CHESTS[count], (0, 1)))
        return _sized(rng, layout, 0.36, 0.48)

    return sized


def _two_doors(rng: Rng) -> Cabinet:
    """A cupboard with two doors over one space."""
    door = Cell("door", "double door", (0, 1), (0, 1), shelves=int(rng.integers(1, 3)))
    height = drawn(rng, 0.46, 0.76)
    layout = Layout((drawn(rng, 0.50, 0.78),), (height,), (door,))
    return _sized(rng, layout, 0.30, 0.38, doors=("frame", "glass", "slab"))


def _wall_cupboard(rng: Rng) -> Cabinet:
    """One door, its handle low."""
    side = "left" if rng.random() < 0.5 else "right"
    shelves = int(rng.integers(1, 3))
    door = Cell("door", "door", (0, 1), (0, 1), side, shelves=shelves, handle_at=0.25)
    layout = Layout((drawn(rng, 0.30, 0.46),), (drawn(rng, 0.42, 0.66),), (door,))
    return _sized(rng, layout, 0.30, 0.38, doors=("glass", "frame", "slab"), feet=False)


def _night_stand(rng: Rng) -> Cabinet:
    """A drawer above a door."""
    side = "left" if rng.random() < 0.5 else "right"
    rows = drawn(rng, 0.27, 0.40), drawn(rng, 0.11, 0.15)
    door = Cell("door", "door", (0, 1), (0, 1), side, handle_at=0.7)
    layout = Layout((drawn(rng, 0.34, 0.46),), rows, (door, *_stack(("drawer",), (0, 1), 1)))
    return _sized(rng, layout, 0.36, 0.42, doors=("frame", "slab"))


def _drawer_over_two_doors(rng: Rng) -> Cabinet:
    """A wide drawer above a double door."""
    rows = drawn(rng, 0.34, 0.52), drawn(rng, 0.12, 0.16)
    door = Cell("door", "double door", (0, 1), (0, 1), shelves=1, handle_at=0.7)
    layout = Layout((drawn(rng, 0.48, 0.70),), rows, (door, *_stack(("drawer",), (0, 1), 1)))
    return _sized(rng, layout, 0.36, 0.44, doors=("frame", "slab", "glass"))


def _two_and_two(rng: Rng) -> Cabinet:
    """Two drawers side by side above two doors."""
    rows = drawn(rng, 0.30, 0.46), drawn(rng, 0.11, 0.15)
    clear = drawn(rng, 0.27, 0.37)
    cells = (
        Cell("right_door", "door", (0, 1), (0, 1), "right", shelves=1, handle_at=0.65),
        Cell("left_door", "door", (1, 2), (0, 1), "left", shelves=1, handle_at=0.65),
        *_stack(("right_drawer",), (0, 1), 1),
        *_stack(("left_drawer",), (1, 2), 1),
    )
    return _sized(rng, Layout((clear, clear), rows, cells), 0.36, 0.44, doors=("frame", "slab"))


def _sideboard(rng: Rng) -> Cabinet:
    """Three drawers between two doors."""
    rows = (drawn(rng, 0.118, 0.170),) * 3
    side = drawn(rng, 0.21, 0.25)
    cells = (
        Cell("right_door", "door", (0, 1), (0, 3), "right", shelves=1),
        Cell("left_door", "door", (2, 3), (0, 3), "left", shelves=1),
        *_stack(DRAWERS, (1, 2)),
    )
    layout = Layout((side, drawn(rng, 0.28, 0.33), side), rows, cells)
    return _sized(rng, layout, 0.36, 0.44, doors=("slab", "frame"))


def _desk_unit(rng: Rng) -> Cabinet:
    """A tall door below, with two drawers above."""
    rows = drawn(rng, 0.26, 0.34), drawn(rng, 0.10, 0.13), drawn(rng, 0.10, 0.13)
    side = "left" if rng.random() < 0.5 else "right"
    cells = (
        Cell("door", "door", (0, 1), (0, 1), side, handle_at=0.75),
        *_stack(("lower_drawer", "upper_drawer"), (0, 1), 1),
    )
    return _sized(rng, Layout((drawn(rng, 0.28, 0.40),), rows, cells), 0.40, 0.48)


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
    depth = drawn(rng, least, most)
    inner = depth - BEHIND
    lowest = min(layout.rows)
    return Cabinet(
        layout,
        depth=depth,
        board=drawn(rng, 0.012, 0.018),
        front=drawn(rng, 0.014, 0.019),
        wall_height=round(min(lowest - 0.040, drawn(rng, 0.4, 0.7) * lowest), 4),
        inner_depth=inner,
        travel=inner - STAYS_IN,
        feet=drawn(rng, 0.03, 0.10) if feet and rng.random() < 0.5 else 0.0,
        crown=drawn(rng, 0.016, 0.022) if feet and rng.random() < 0.5 else 0.0,
        style=doors[int(rng.integers(len(doors)))],
    )


# Thirteen kinds and seven pulls, so that the two go through all their combinations.
_KINDS: tuple[Callable[[Rng], Cabinet], ...] = (
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


def _bar(rng: Rng, rgba: Colour) -> Handle:
    return BarHandle(
        length=drawn(rng, 0.120, 0.140),
        thickness=drawn(rng, 0.010, 0.012),
        standoff=drawn(rng, 0.035, 0.040),
        rgba=rgba,
    )


def _long_bar(rng: Rng, rgba: Colour) -> Handle:
    return BarHandle(
        length=drawn(rng, 0.160, 0.220),
        thickness=drawn(rng, 0.011, 0.013),
        standoff=drawn(rng, 0.030, 0.036),
        inset=drawn(rng, 0.025, 0.040),
        rounding=0.004,
        rgba=rgba,
    )


def _bow(rng: Rng, rgba: Colour) -> Handle:
    width = drawn(rng, 0.009, 0.011)
    return BowHandle(
        span=float(rng.choice([0.096, 0.128, 0.160])),
        width=width,
        thickness=width + drawn(rng, 0.0, 0.002),
        standoff=drawn(rng, 0.028, 0.036),
        power=drawn(rng, 2.8, 4.5),
        rgba=rgba,
    )


def _knob(rng: Rng, rgba: Colour) -> Handle:
    diameter = drawn(rng, 0.026, 0.031)
    return Knob(
        diameter=diameter,
        stem=drawn(rng, 0.014, 0.018),
        depth=diameter + drawn(rng, 0.001, 0.003),
        neck=drawn(rng, 0.36, 0.44),
        rgba=rgba,
    )


def _edge(rng: Rng, rgba: Colour) -> Handle:
    height = drawn(rng, 0.010, 0.013)
    return EdgePull(
        length=drawn(rng, 0.10, 0.20),
        height=height,
        thickness=height + drawn(rng, 0.0, 0.002),
        standoff=drawn(rng, 0.028, 0.034),
        rgba=rgba,
    )


_PULLS: tuple[Callable[[Rng, Colour], Handle], ...] = (
    _long_bar,
    _bow,
    _knob,
    _bar,
    _edge,
    _bow,
    _knob,
    _long_bar,
    _edge,
)
