"""How a cabinet's front is divided: a grid of columns and rows, and cells that span some of both.

Columns are counted from -y to +y (seen from the front: from the right to the left), rows from the bottom.
Between two columns or rows is a board, unless a cell spans both. A line is where the middle of such a board
is; the outermost lines are the carcass's own outer faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Span = tuple[int, int]  # the first line and the last


@dataclass(frozen=True)
class Cell:
    """What fills a rectangle of the grid.

    Attributes:
      name: Of the moving part; a double door's leaves are named `left_` and `right_` and this.
      kind: A drawer, a door, or a double door over one space.
      columns, rows: From which line to which.
      hinge: The door's side as seen from the front.
      shelves: Boards inside, evenly spread over the height, behind a door.
      handle_at: Where the handle of a door is, as a share of its height.
    """

    name: str
    kind: Literal["drawer", "door", "double door"]
    columns: Span
    rows: Span
    hinge: Literal["left", "right"] = "left"
    shelves: int = 0
    handle_at: float = 0.5


@dataclass(frozen=True)
class Layout:
    """Clear widths of the columns and heights of the rows [m], without boards, and the cells."""

    columns: tuple[float, ...]
    rows: tuple[float, ...]
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Lines:
    """The lines of one direction.

    Attributes: at, where they are [m]; board, its thickness [m].
    """

    at: tuple[float, ...]
    board: float

    @classmethod
    def between(cls, clear: tuple[float, ...], board: float, start: float) -> Lines:
        """Lines from `start` on, with these clear lengths between the boards."""
        inner = [start + (k + 0.5) * board + sum(clear[:k]) for k in range(1, len(clear))]
        last = start + sum(clear) + (len(clear) + 1) * board
        return cls((start, *inner, last), board)

    @property
    def count(self) -> int:
        """Of the columns or rows."""
        return len(self.at) - 1

    def clear(self, span: Span) -> tuple[float, float]:
        """The space between the boards at both ends of a span."""
        first, last = span
        low = self.at[first] + self.board * (1.0 if first == 0 else 0.5)
        return low, self.at[last] - self.board * (1.0 if last == self.count else 0.5)

    def cover(self, span: Span, gap: float) -> tuple[float, float]:
        """What a front over a span covers: to the outer faces, and up to half a gap from inner lines."""
        first, last = span
        low = self.at[first] + (0.0 if first == 0 else gap / 2)
        return low, self.at[last] - (0.0 if last == self.count else gap / 2)


def uprights(layout: Layout) -> list[tuple[int, Span]]:
    """The boards between columns: the line each is on, and the rows it spans."""
    return [
        (line, run)
        for line in range(1, len(layout.columns))
        for run in _runs(
            [
                all(
                    not _crosses(cell.columns, line)
                    for cell in layout.cells
                    if _holds(cell.rows, row)
                )
                for row in range(len(layout.rows))
            ]
        )
    ]


def levels(layout: Layout) -> list[tuple[int, Span]]:
    """The boards between rows: the line each is on, and the columns it spans between uprights."""
    standing = uprights(layout)
    found: list[tuple[int, Span]] = []
    for line in range(1, len(layout.rows)):
        for first, last in _runs(
            [
                all(
                    not _crosses(cell.rows, line)
                    for cell in layout.cells
                    if _holds(cell.columns, k)
                )
                for k in range(len(layout.columns))
            ]
        ):
            through = [at for at, run in standing if first < at < last and _crosses(run, line)]
            ends = [first, *through, last]
            found += [(line, span) for span in zip(ends[:-1], ends[1:], strict=True)]
    return found


def _crosses(span: Span, line: int) -> bool:
    return span[0] < line < span[1]


def _holds(span: Span, cell: int) -> bool:
    return span[0] <= cell < span[1]


def _runs(chosen: list[bool]) -> list[Span]:
    """Where the list is true without a break."""
    edges = np.flatnonzero(np.diff([False, *chosen, False]))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
