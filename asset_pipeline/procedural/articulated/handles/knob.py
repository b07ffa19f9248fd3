"""A round knob: a stem that flares into a domed head.

Sold furniture knobs are 25-38 mm across and stand 24-34 mm off the face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.labelling.handle_label import ROUND
from asset_pipeline.procedural.articulated.handles.mounted import (
    ALUMINIUM,
    Direction,
    Mounted,
    handle_axes,
)
from asset_pipeline.procedural.articulated.handles.portion import moved, portion
from asset_pipeline.procedural.revolution import convex_part, fillet, lathe
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

SECTIONS = 32
CORNERS = 10  # of the collision parts' sections
# The outward axis of revolution is Y, and a symmetry group has every turn about X or a finite number.
TURNS = ROUND
# From the face outwards, z on the axis: rotates into -x.
OUTWARDS = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class Knob:
    """Sizes [m]: diameter of the head, of the stem at the face, how far it stands off the face, and
    the share of that which is stem; the colour."""

    diameter: float = 0.030
    stem: float = 0.016
    depth: float = 0.031
    neck: float = 0.40
    rgba: Colour = (0.16, 0.16, 0.17, 1.0)

    @property
    def length(self) -> float:
        """The diameter."""
        return self.diameter

    def mounted(self, foot: Float[np.ndarray, "3"], direction: Direction) -> Mounted:
        """The knob in its place, see `Handle`.

        The label is that of its bounding box. A knob is a body of revolution about Y, which the
        group holds as turns by 15 deg.
        """
        radius, stem, neck = self.diameter / 2, self.stem / 2, self.neck * self.depth
        flare = neck + 0.25 * (self.depth - neck)
        widest = neck + 0.5 * (self.depth - neck)
        corners = np.array(
            [
                (0.0, 0.0),
                (stem, 0.0),
                (0.8 * stem, neck),
                (0.92 * radius, flare),
                (radius, widest),
                (0.85 * radius, self.depth),
                (0.0, self.depth),
            ]
        )
        smooth = fillet(corners, {2: 0.1 * stem, 3: 0.2 * radius, 5: 0.3 * radius}, steps=3)
        surface = lathe(smooth, SECTIONS)
        parts = (
            _frustums([(stem, 0.0), (0.8 * stem, neck)]),
            _frustums([(0.8 * stem, neck), (0.92 * radius, flare), (radius, widest)]),
            _frustums(
                [(radius, widest), (0.95 * radius, 0.7 * self.depth + 0.3 * widest)]
                + [(0.72 * radius, self.depth)]
            ),
        )
        knob = portion([Shape("mesh", mesh=surface, rgba=self.rgba)], parts, ALUMINIUM)
        centre = np.asarray(foot, float) + self.depth / 2 * OUTWARDS[:, 2]
        turns = [
            rotation_about(np.array([0.0, 1.0, 0.0]), 2 * np.pi * k / TURNS) for k in range(TURNS)
        ]
        label = PoseLabel(
            origin=centre,
            rotation=handle_axes(direction),
            object_type="handle",
            extents=np.array([self.diameter, self.depth, self.diameter]),
            symmetry=SymmetryGroup(np.stack(turns)),
        )
        return Mounted(moved(knob, compose(OUTWARDS, np.asarray(foot, float))), label)


def _frustums(rings: list[tuple[float, float]]) -> Shape:
    """The hull of polygons about z, half as far outside the circles as inside."""
    angles = np.arange(CORNERS) * (2 * np.pi / CORNERS)
    grown = (1 + 1 / np.cos(np.pi / CORNERS)) / 2
    return convex_part(
        np.concatenate(
            [
                np.column_stack(
                    [grown * r * np.cos(angles), grown * r * np.sin(angles), np.full(CORNERS, z)]
                )
                for r, z in rings
            ]
        )
    )
