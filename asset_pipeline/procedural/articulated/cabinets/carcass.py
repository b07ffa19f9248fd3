"""A cabinet's carcass: covers, sides, the boards of its layout, shelves, backs, feet and an overhanging top."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np

from asset_pipeline.procedural.articulated.cabinets.layout import levels, uprights
from asset_pipeline.procedural.articulated.cabinets.sizes import WOOD, Cabinet
from asset_pipeline.procedural.articulated.handles.portion import Portion, portion
from asset_pipeline.procedural.solids import box
from manipose_mj.assets.geometry import Shape

SHELF_BACK = 0.02  # how far shelves stand behind the carcass's front [m]
FOOT, FOOT_INSET = 0.034, 0.012
Corner = tuple[float, float, float]
Ends = tuple[Corner, Corner]


def carcass(c: Cabinet) -> Portion:
    """All of a cabinet that does not move."""
    outer, inner = _outer_boards(c), _inner_boards(c)
    shapes = [box(low, high, c.wood) for low, high in outer]
    shapes += [box(low, high, c.inside) for low, high in inner]
    shapes += _feet_and_crown(c)
    return portion(shapes, shapes, WOOD)


def _full_uprights(c: Cabinet) -> list[int]:
    """The lines of the boards that go from the bottom to the top, the sides among them."""
    whole = [line for line, run in uprights(c.layout) if run == (0, c.upward.count)]
    return [0, *whole, c.across.count]


def _outer_boards(c: Cabinet) -> list[Ends]:
    """Bottom, top, sides, and the boards that stand from the one to the other."""
    x, y, t = c.depth / 2, c.width / 2, c.board
    low, high = c.feet, c.height
    at = [c.across.at[line] for line in _full_uprights(c)[1:-1]]
    return [
        ((-x, -y, low), (x, y, low + t)),
        ((-x, -y, high - t), (x, y, high)),
        ((-x, -y, low + t), (x, -y + t, high - t)),
        *(((-x, line - t / 2, low + t), (x, line + t / 2, high - t)) for line in at),
        ((-x, y - t, low + t), (x, y, high - t)),
    ]


def _inner_boards(c: Cabinet) -> list[Ends]:
    """Partial uprights, boards between rows, shelves, and a back behind each compartment."""
    x, t = c.depth / 2, c.board
    whole = _full_uprights(c)
    boards: list[Ends] = []
    for line, run in uprights(c.layout):
        if line not in whole:
            y, (low, high) = c.across.at[line], c.upward.clear(run)
            boards.append(((-x, y - t / 2, low), (x - t, y + t / 2, high)))
    for line, span in levels(c.layout):
        (right, left), z = c.across.clear(span), c.upward.at[line] - t / 2
        boards.append(((-x, right, z), (x - t, left, z + t)))
    for cell in c.layout.cells:
        right, left = c.across.clear(cell.columns)
        boards += [
            ((-x + SHELF_BACK, right, z), (x - t, left, z + t)) for z in c.shelf_heights(cell)
        ]
    for span in pairwise(whole):
        right, left = c.across.clear(span)
        boards.append(((x - t, right, c.feet + t), (x, left, c.height - t)))
    return boards


def _feet_and_crown(c: Cabinet) -> list[Shape]:
    x, y = c.depth / 2, c.width / 2
    shapes = []
    if c.feet:
        reach = np.array([x, y]) - FOOT_INSET - FOOT / 2
        half = np.array([FOOT, FOOT, c.feet]) / 2
        for signs in product((-1, 1), (-1, 1)):
            middle = np.array([*(signs * reach), c.feet / 2])
            shapes.append(box(middle - half, middle + half, c.wood))
    if c.crown:
        front = c.face - c.front - c.overhang
        low = (front, -y - c.overhang, c.height)
        shapes.append(box(low, (x, y + c.overhang, c.height + c.crown), c.wood))
    return shapes
