"""A portion of a body: shapes of given densities, and what is seen of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry.mass import shape_mass_properties
from asset_pipeline.procedural.pieces import placed_shape
from manipose_mj.assets.geometry import Shape


@dataclass(frozen=True)
class Portion:
    """Attributes: visual, what is seen; collision, convex shapes; densities, of each of those
    [kg/m^3], from which a body has its mass."""

    visual: tuple[Shape, ...]
    collision: tuple[Shape, ...]
    densities: tuple[float, ...]


def portion(visual: Sequence[Shape], collision: Sequence[Shape], density: float) -> Portion:
    """A portion of one material."""
    return Portion(tuple(visual), tuple(collision), (density,) * len(collision))


def weighing(visual: Sequence[Shape], collision: Sequence[Shape], mass: float) -> Portion:
    """A portion of one mean density that weighs so much [kg]: sheet metal around air."""
    return portion(visual, collision, mass / shape_mass_properties(collision, 1.0).mass)


def moved(part: Portion, pose: Float[np.ndarray, "4 4"]) -> Portion:
    """The portion moved by a rigid transform."""
    return Portion(
        tuple(placed_shape(s, pose) for s in part.visual),
        tuple(placed_shape(s, pose) for s in part.collision),
        part.densities,
    )
