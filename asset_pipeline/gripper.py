"""The geometry of a parallel-jaw hand, as far as grasp sampling needs it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Box = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class ParallelJaw:
    """A two-finger hand in its tcp frame; the defaults are the Franka hand's.

    z points out of the hand, y is the closing direction, the origin lies midway between the pads'
    centres. Boxes are (lower corner, upper corner) [m]. The finger's are those of the finger at +y
    and measured from its pad's face (y = 0 there); the other finger is its half turn about z.

    Attributes:
      max_opening: Between the pads' faces [m].
      pad_half_width: Along x [m].
      pad_half_height: Along z [m].
      clearance: How much further than the object each pad is open on approach, where it can be [m].
      min_clearance: The least `opening - width` a grasp needs [m].
      finger: The finger's boxes, the pad's among them.
      hand: The boxes that do not move.
    """

    max_opening: float = 0.08
    pad_half_width: float = 0.0088
    pad_half_height: float = 0.009
    clearance: float = 0.006
    min_clearance: float = 0.003
    finger: tuple[Box, ...] = (
        ((-0.0100, 0.0, -0.009), (0.0100, 0.0150, 0.009)),
        ((-0.0100, 0.008, -0.027), (0.0100, 0.0230, -0.009)),
        ((-0.0105, 0.010, -0.045), (0.0105, 0.0260, -0.027)),
    )
    hand: tuple[Box, ...] = (((-0.032, -0.104, -0.112), (0.032, 0.104, -0.037)),)

    def opening(self, width: float | Float[np.ndarray, "*n"]) -> np.ndarray:
        """How far to open [m] before approaching something of this width [m]."""
        return np.minimum(self.max_opening, np.asarray(width) + 2 * self.clearance)

    def boxes(self, opening: float) -> Float[np.ndarray, "boxes 2 3"]:
        """Every box of the hand at this opening [m], in the tcp frame."""
        finger = np.array(self.finger)
        finger[:, :, 1] += opening / 2
        turned = finger * [-1, -1, 1]
        return np.concatenate([finger, np.sort(turned, axis=1), np.array(self.hand)])
