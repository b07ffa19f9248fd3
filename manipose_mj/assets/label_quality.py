"""How sure a measured label is, and how far the surface is from the symmetry that it claims."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class LabelQuality:
    """What the labeller knows about a label beside its frame.

    Attributes:
      confidence: From 0, guessed, to 1, where everything that fixed the frame was clear. The least of
        the evidence for each decision (plane, sign, joint ...), not a probability.
      residuals: By what was tried (`"axis"`: every turn about X; `"plane"`; `"second_plane"`;
        `"half_turn"`: about X; `"flip"`: about Y), the 95th percentile of the distance of the moved
        surface from itself [m]; `"parts"`: the 90th over handles alone under the mirror plane.
    """

    confidence: float
    residuals: dict[str, float] = field(default_factory=dict)


def clear(value: float, needed: float) -> float:
    """Evidence from 0 to 1: `value` as a share of what leaves no uncertainty."""
    return float(np.clip(value / needed, 0.0, 1.0))


def fits(residual: float, limit: float) -> float:
    """Evidence from 1, a residual of half the limit or less, to 0, one and a half times the limit."""
    return float(np.clip(1.5 - residual / limit, 0.0, 1.0))
