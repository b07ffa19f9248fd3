"""Handles of random sizes, each within the range of sold ones that its module names."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from asset_pipeline.procedural.articulated.handles.bar_handle import BarHandle
from asset_pipeline.procedural.articulated.handles.bow_handle import BowHandle
from asset_pipeline.procedural.articulated.handles.edge_pull import EdgePull
from asset_pipeline.procedural.articulated.handles.knob import Knob
from asset_pipeline.procedural.articulated.handles.mounted import Handle
from asset_pipeline.procedural.specimen import Colour, uniform

Range = tuple[float, float]
Pull = Callable[[np.random.Generator, Colour], Handle]


def bar(
    length: Range,
    *,
    thickness: Range = (0.010, 0.013),
    standoff: Range = (0.030, 0.038),
    inset: Range = (0.014, 0.030),
    rounding: float = 0.004,
) -> Pull:
    """Bars of a length in a range; all sizes in metres, as in `BarHandle`."""

    def pull(rng: np.random.Generator, rgba: Colour) -> Handle:
        return BarHandle(
            length=uniform(rng, *length),
            thickness=uniform(rng, *thickness),
            standoff=uniform(rng, *standoff),
            inset=uniform(rng, *inset),
            rounding=rounding,
            rgba=rgba,
        )

    return pull


def bow(span: Range, *, standoff: Range = (0.028, 0.036), power: Range = (2.8, 4.5)) -> Pull:
    """Arches of a span in a range, nearly as wide as thick."""

    def pull(rng: np.random.Generator, rgba: Colour) -> Handle:
        width = uniform(rng, 0.009, 0.012)
        return BowHandle(
            span=uniform(rng, *span),
            width=width,
            thickness=width + uniform(rng, 0.0, 0.002),
            standoff=uniform(rng, *standoff),
            power=uniform(rng, *power),
            rgba=rgba,
        )

    return pull


def edge(length: Range) -> Pull:
    """Edge pulls of a length in a range."""

    def pull(rng: np.random.Generator, rgba: Colour) -> Handle:
        height = uniform(rng, 0.010, 0.013)
        return EdgePull(
            length=uniform(rng, *length),
            height=height,
            thickness=height + uniform(rng, 0.0, 0.002),
            standoff=uniform(rng, 0.028, 0.034),
            rgba=rgba,
        )

    return pull


def knob(rng: np.random.Generator, rgba: Colour) -> Handle:
    """A knob that stands off as far as it is wide, or a little farther."""
    diameter = uniform(rng, 0.026, 0.031)
    return Knob(
        diameter=diameter,
        stem=uniform(rng, 0.014, 0.018),
        depth=diameter + uniform(rng, 0.001, 0.003),
        neck=uniform(rng, 0.36, 0.44),
        rgba=rgba,
    )
