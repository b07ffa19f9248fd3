"""A base and its moving parts, put together from portions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry.mass import shape_mass_properties
from asset_pipeline.labelling.articulated_label import articulated_label
from asset_pipeline.procedural.articulated.handles.mounted import Mounted
from asset_pipeline.procedural.articulated.handles.portion import Portion
from asset_pipeline.procedural.specimen import Specimen
from manipose_mj.assets.asset import Cavity, MovingPart
from manipose_mj.assets.geometry import Body, Joint


@dataclass(frozen=True)
class Part:
    """A moving part: its body, and what `asset.json` says of it."""

    body: Body
    entry: MovingPart


def body_of(
    name: str, portions: Sequence[Portion], joint: Joint | None = None, *, balanced: float = 0.0
) -> Body:
    """A rigid body made of portions; `joint` and `balanced` as in `Body`."""
    collision = [s for portion in portions for s in portion.collision]
    densities = [d for portion in portions for d in portion.densities]
    return Body(
        name=name,
        collision=tuple(collision),
        visual=tuple(s for portion in portions for s in portion.visual),
        mass_properties=shape_mass_properties(collision, densities),
        joint=joint,
        balanced=balanced,
    )


def moving(
    name: str,
    portions: Sequence[Portion],
    handle: Mounted,
    joint: Joint,
    cavity: Cavity,
    *,
    balanced: float = 0.0,
) -> Part:
    """A drawer or a door: what it is made of, its handle, its joint and the space it opens."""
    body = body_of(name, [*portions, handle.portion], joint, balanced=balanced)
    return Part(body, MovingPart(name, joint, handle.label, cavity))


def articulated_specimen(base: Sequence[Portion], parts: Sequence[Part]) -> Specimen:
    """The whole, everything shut; the front is towards -x."""
    bodies = (body_of("base", base), *(part.body for part in parts))
    return Specimen(articulated_label(bodies), bodies, tuple(part.entry for part in parts))


def space_between(
    low: Float[np.ndarray, "3"] | tuple[float, float, float],
    high: Float[np.ndarray, "3"] | tuple[float, float, float],
    *,
    moves_with_part: bool,
) -> Cavity:
    """The cavity between two corners."""
    lower, upper = np.asarray(low, float), np.asarray(high, float)
    return Cavity((lower + upper) / 2, upper - lower, moves_with_part)
