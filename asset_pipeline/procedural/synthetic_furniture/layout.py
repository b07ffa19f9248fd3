"""How the fronts of synthetic furniture are divided: styles, and a random division of one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.articulated.cabinets.layout import Cell, Layout

Range = tuple[float, float]


@dataclass(frozen=True)
class FurnitureStyle:
    """Between which sizes a kind of furniture is drawn.

    Attributes:
      columns, width: How many, and the clear width of each [m].
      rows, heights: The same of rows [m].
      depth: Of the carcass [m].
      front: Thickness of doors and drawers' fronts [m].
      drawers: Share of low cells that are drawers.
      open: Share of cells that nothing shuts.
      flaps: Share of single doors that turn about a level axis; upwards, of these, about the upper one.
      merge: Share of doors that go on in the row above.
      single: Clear width up to which one door may shut a cell [m].
      feet: Whether it may have some.
      desk: Whether a table top is over it.
    """

    columns: tuple[int, int]
    width: Range
    rows: tuple[int, int]
    heights: Range
    depth: Range = (0.35, 0.60)
    front: Range = (0.012, 0.024)
    drawers: float = 0.85
    open: float = 0.08
    flaps: float = 0.0
    upwards: float = 0.5
    merge: float = 0.2
    single: float = 0.80
    feet: bool = True
    desk: bool = False


_WARDROBE = FurnitureStyle((1, 3), (0.35, 0.60), (2, 5), (0.20, 0.60), merge=0.75, drawers=0.6)
_TALL_DOORS = FurnitureStyle(
    (1, 3), (0.28, 0.55), (1, 1), (1.00, 1.90), depth=(0.30, 0.60), open=0.0
)
_DRESSER = FurnitureStyle((1, 4), (0.30, 0.75), (2, 6), (0.10, 0.26), depth=(0.35, 0.55))
_SIDEBOARD = FurnitureStyle((2, 4), (0.30, 0.60), (1, 3), (0.14, 0.55), drawers=0.7)
_FLAPS = FurnitureStyle(
    *((1, 2), (0.50, 1.25), (1, 2), (0.25, 0.60), (0.28, 0.48)), flaps=0.9, drawers=0.1, merge=0.0
)
_DESK = FurnitureStyle(
    *((1, 2), (0.28, 0.60), (1, 4), (0.10, 0.45), (0.35, 0.60)), merge=0.3, feet=False, desk=True
)
_FRIDGE = FurnitureStyle(
    *((1, 2), (0.42, 0.75), (1, 2), (0.45, 1.15), (0.50, 0.68), (0.03, 0.08)),
    drawers=0.3,
    open=0.0,
    merge=0.4,
)
_DISHWASHER = FurnitureStyle(
    *((1, 1), (0.42, 0.75), (1, 1), (0.45, 0.80), (0.50, 0.65), (0.02, 0.07)),
    open=0.0,
    flaps=0.85,
    upwards=0.1,
)
_MICROWAVE = FurnitureStyle(
    *((1, 1), (0.25, 0.50), (1, 1), (0.18, 0.45), (0.28, 0.50), (0.02, 0.07)),
    open=0.0,
    drawers=0.0,
    flaps=0.15,
    upwards=0.1,
)
# Few and wide doors: models of furniture are often of no true size.
_WIDE_DOORS = FurnitureStyle(
    *((1, 2), (0.55, 1.05), (1, 2), (0.30, 0.95), (0.30, 0.60)),
    drawers=0.3,
    open=0.0,
    merge=0.4,
    single=1.05,
)
_SHELF = FurnitureStyle((1, 3), (0.28, 0.70), (3, 6), (0.20, 0.42), depth=(0.25, 0.45), open=0.4)
STYLES = (
    *(_TALL_DOORS, _DRESSER, _FLAPS, _WARDROBE, _DESK, _SIDEBOARD),
    *(_FRIDGE, _TALL_DOORS, _SHELF, _DISHWASHER, _WARDROBE, _WIDE_DOORS, _WIDE_DOORS, _MICROWAVE),
)
_MOST = 10  # parts
_WIDEST, _HIGHEST = 2.2, 2.1  # [m]
_DRAWER_UP_TO, _TALL = 0.30, 0.40  # clear heights of cells [m]
_DOUBLE_FROM = 0.50  # clear width [m]


def random_layout(style: FurnitureStyle, rng: np.random.Generator) -> Layout:
    """A random division with at least one part, and not more than can be trained on."""
    count = int(rng.integers(style.columns[0], style.columns[1] + 1))
    width = rng.uniform(*style.width)
    # Columns alike, or each its own.
    alike = rng.random() < 0.6
    columns = tuple(width if alike else rng.uniform(*style.width) for _ in range(count))
    levels = int(rng.integers(style.rows[0], style.rows[1] + 1))
    height = rng.uniform(*style.heights)
    even = rng.random() < 0.4
    rows = tuple(height if even else rng.uniform(*style.heights) for _ in range(levels))
    columns, rows = _within(columns, _WIDEST), _within(rows, _HIGHEST)
    count, levels = len(columns), len(rows)
    cells: list[Cell] = []
    used = np.zeros((count, levels), bool)
    for row in range(levels):
        through = count > 1 and rng.random() < 0.2
        for column in range(count):
            if used[column, row]:
                continue
            span = column, column + 1
            if through and not used[:, row].any():
                span = 0, count
            cell = _cell(style, columns, rows, span, row, rng)
            used[slice(*span), row] = True
            if cell is None:
                continue
            used[slice(*span), slice(*cell.rows)] = True
            parts = sum(2 if other.kind == "double door" else 1 for other in cells)
            if parts + (2 if cell.kind == "double door" else 1) <= _MOST:
                cells.append(cell)
    if not cells:
        hinge = "left" if rng.random() < 0.5 else "right"
        cells.append(Cell("door", "door", (0, 1), (0, levels), hinge))
    return Layout(columns, rows, tuple(cells))


def _within(sizes: tuple[float, ...], most: float) -> tuple[float, ...]:
    """The sizes, or as many of the first as come to no more than `most` [m]."""
    return tuple(s for s, end in zip(sizes, np.cumsum(sizes), strict=True) if end <= most)


def _cell(
    style: FurnitureStyle,
    columns: tuple[float, ...],
    rows: tuple[float, ...],
    span: tuple[int, int],
    row: int,
    rng: np.random.Generator,
) -> Cell | None:
    """What is over some columns from a row on; None if nothing shuts it."""
    if rng.random() < style.open:
        return None
    name = f"{span[0]}_{row}"
    width = sum(columns[slice(*span)])
    if rows[row] < _DRAWER_UP_TO and rng.random() < style.drawers:
        return Cell(f"drawer_{name}", "drawer", span, (row, row + 1))
    last = row + 1
    while last < len(rows) and rng.random() < style.merge:
        last += 1
    height = sum(rows[row:last])
    shelves = int(rng.integers(0, 1 + max(1, int(height / 0.35)))) if height > _TALL else 0
    double = width > style.single or (width > _DOUBLE_FROM and rng.random() < 0.5)
    if double and rng.random() >= style.flaps:
        return Cell(f"door_{name}", "double door", span, (row, last), shelves=shelves)
    hinge = "left" if rng.random() < 0.5 else "right"
    return Cell(f"door_{name}", "door", span, (row, last), hinge, shelves=shelves)
