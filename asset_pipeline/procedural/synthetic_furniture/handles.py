"""Handles of synthetic furniture: what the catalogue's furniture has, in more sizes, and plain blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.articulated.handles.bar_handle import BarHandle
from asset_pipeline.procedural.articulated.handles.bow_handle import BowHandle
from asset_pipeline.procedural.articulated.handles.edge_pull import EdgePull
from asset_pipeline.procedural.articulated.handles.knob import Knob
from asset_pipeline.procedural.articulated.handles.mounted import (
    ALUMINIUM,
    Direction,
    Handle,
    Mounted,
    handle_axes,
)
from asset_pipeline.procedural.articulated.handles.portion import moved, portion
from asset_pipeline.procedural.solids import box
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup, compose

_LEAST_DEPTH = 0.017  # of knobs: their middles stand out from the deepest panel's frame [m]


@dataclass(frozen=True)
class BlockHandle:
    """A block on the face: its length, its height along the face and its depth off it [m]."""

    length: float
    height: float
    depth: float

    def mounted(self, foot: Float[np.ndarray, "3"], direction: Direction) -> Mounted:
        """The block in its place, see `Handle`; the label is that of all of it."""
        half = np.array([self.length, 0.0, self.height]) / 2
        shape = box(-half, half + np.array([0.0, self.depth, 0.0]))
        block = portion([shape], [shape], ALUMINIUM)
        rotation = handle_axes(direction)
        label = PoseLabel(
            origin=np.asarray(foot, float) + self.depth / 2 * rotation[:, 1],
            rotation=rotation,
            object_type="handle",
            extents=np.array([self.length, self.depth, self.height]),
            symmetry=SymmetryGroup(np.stack([np.eye(3), np.diag([-1.0, 1.0, -1.0])])),
        )
        return Mounted(moved(block, compose(rotation, np.asarray(foot, float))), label)


def random_handle(rng: np.random.Generator, longest: float) -> Handle:
    """A handle that takes at most so much room along its X [m]; a knob of 10 mm always may be."""
    kind = rng.choice(["bar", "bow", "knob", "edge", "block"], p=[0.42, 0.16, 0.26, 0.06, 0.10])
    # As many short ones as long ones.
    length = float(np.exp(rng.uniform(np.log(0.06), np.log(0.70))))
    length = min(length, longest)
    if kind == "knob" or length < 0.05:
        diameter = float(np.exp(rng.uniform(np.log(0.010), np.log(0.042))))
        depth = max(diameter * rng.uniform(0.6, 1.3), _LEAST_DEPTH)
        stem = diameter * rng.uniform(0.4, 0.6)
        return Knob(diameter=diameter, stem=stem, depth=depth, neck=rng.uniform(0.30, 0.45))
    standoff = rng.uniform(0.014, 0.045)
    thickness = rng.uniform(0.007, 0.016)
    if kind == "bow":
        span = min(length, 0.35) - thickness
        power = rng.uniform(2.0, 4.5)
        return BowHandle(span, thickness, thickness, standoff, power)
    if kind == "edge":
        return EdgePull(min(length, 0.4), thickness, thickness, standoff)
    if kind == "block":
        return BlockHandle(min(length, 0.25), rng.uniform(0.008, 0.03), rng.uniform(0.010, 0.035))
    if length > 0.25:
        thickness *= rng.uniform(1.0, 2.0)
    inset = thickness / 2 + rng.uniform(0.0, 0.2) * (length - 2 * thickness)
    return BarHandle(length, thickness, standoff, inset, 0.2 * thickness)
