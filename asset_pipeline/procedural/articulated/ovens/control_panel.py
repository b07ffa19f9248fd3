"""What is on an appliance's control panel, in colours that stand out from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.articulated.ovens.controls import (
    GLOW,
    Place,
    clock,
    dial,
    keys,
    raised,
    ring_of_marks,
)
from asset_pipeline.procedural.solids import box
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape

BLACK: Colour = (0.03, 0.03, 0.04, 1.0)
WHITE: Colour = (0.90, 0.90, 0.91, 1.0)
START: Colour = (0.20, 0.60, 0.32, 1.0)
STOP: Colour = (0.74, 0.22, 0.18, 1.0)
SCREEN = 0.0008  # how far a display stands off the panel [m]
DIAL = 0.018  # and a dial
MARKS = 1.35  # radius of the marks around a dial, in dials' radii


@dataclass(frozen=True)
class Panel:
    """A flat box whose outer side is at low x. Attributes: low, high, corners `(3,)` [m]; rgba."""

    low: Float[np.ndarray, "3"]
    high: Float[np.ndarray, "3"]
    rgba: Colour

    @property
    def size(self) -> Place:
        """Width and height [m]."""
        width, height = self.high[1:] - self.low[1:]
        return float(width), float(height)

    @property
    def dark(self) -> bool:
        """Whether light things stand out from it."""
        return sum(self.rgba[:3]) < 1.2

    @property
    def face(self) -> float:
        """Where its outer side is, along x [m]."""
        return float(self.low[0])

    def at(self, across: float, up: float) -> Place:
        """y and z at these shares of its width, from its low y, and of its height."""
        return cast(
            Place, tuple((self.low + np.array([0, across, up]) * (self.high - self.low))[1:])
        )

    def solid(self) -> Shape:
        """The box."""
        return box(self.low, self.high, self.rgba)


def keypad(panel: Panel, time: str) -> list[Shape]:
    """A display, twelve keys, and under them a red and a green one."""
    width, height = panel.size
    key: Colour = (0.34, 0.34, 0.36, 1.0) if panel.dark else (0.80, 0.80, 0.79, 1.0)
    large = 0.36 * width, 0.10 * height
    return [
        *display(panel, panel.at(0.5, 0.84), (0.80 * width, 0.13 * height), time, rgba=GLOW),
        keys(panel.face, panel.at(0.5, 0.50), (0.82 * width, 0.44 * height), (4, 3), rgba=key),
        raised(panel.face, panel.at(0.29, 0.15), large, 0.0015, rgba=START),
        raised(panel.face, panel.at(0.71, 0.15), large, 0.0015, rgba=STOP),
    ]


def display(panel: Panel, at: Place, size: Place, time: str, *, rgba: Colour) -> list[Shape]:
    """The time, in digits 0.57 as high as the black screen, of width and height `size` [m]."""
    return [
        raised(panel.face, at, size, SCREEN, rgba=BLACK),
        clock(panel.face - SCREEN, at, 0.57 * size[1], time, rgba=rgba),
    ]


def dials(panel: Panel, places: Sequence[Place], radius: float) -> tuple[list[Shape], list[Shape]]:
    """Dials with marks around them, each turned differently: what is seen, and what is touched."""
    body: Colour = (0.75, 0.75, 0.76, 1.0) if panel.dark else (0.22, 0.22, 0.23, 1.0)
    mark, ink = (BLACK, WHITE) if panel.dark else (WHITE, BLACK)
    visuals, solid = [], []
    for k, at in enumerate(places):
        seen, touched = dial(panel.face, at, radius, DIAL, 0.8 * k - 0.7, rgba=body, mark=mark)
        visuals += [*seen, ring_of_marks(panel.face, at, MARKS * radius, 9 + 2 * k, rgba=ink)]
        solid += touched
    return visuals, solid
