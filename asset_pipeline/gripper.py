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
    centres. Boxes are (lower corner, upper corner) [m] and cover the collision geometry of
    `manipose_mj.mjcf.panda_geometry` (a test holds that). The finger's are those of the finger at +y,
    measured from its pad's face (y = 0 there); the other finger is its half turn about z.

    Attributes:
      max_opening: Between the pads' faces [m].
      pad_half_width: Along x [m].
      pad_half_height: Along z [m].
      clearance: How much further than the object each pad is open on approach, where it can be [m].
      min_clearance: The least `opening - width` a grasp needs [m].
      grip_force: Of each pad [N]: the Franka hand data sheet's continuous force.
      finger: The finger's boxes: pad, fingertip, middle, base.
      hand: The boxes that do not move: body, flange, cable plug and the wrist that carries the hand.
        Plug and wrist are one-sided on the robot; here they are on both, as a grasp stands for its
        half turn too.
    """

    max_opening: float = 0.08
    pad_half_width: float = 0.0088
    pad_half_height: float = 0.009
    clearance: float = 0.006
    min_clearance: float = 0.003
    grip_force: float = 70.0
    finger: tuple[Box, ...] = (
        ((-0.0088, 0.0, -0.009), (0.0088, 0.003, 0.009)),
        ((-0.0088, 0.003, -0.009), (0.0088, 0.0145, 0.009)),
        ((-0.0095, 0.008, -0.0255), (0.0095, 0.023, -0.009)),
        ((-0.0105, 0.0103, -0.045), (0.0105, 0.0258, -0.0255)),
    )
    hand: tuple[Box, ...] = (
        ((-0.0205, -0.1025, -0.1114), (0.0205, 0.1025, -0.0374)),
        ((-0.0315, -0.036, -0.1114), (0.0315, 0.036, -0.0914)),
        ((-0.007, -0.104, -0.1294), (0.007, 0.104, -0.1114)),
        ((-0.045, -0.045, -0.1774), (0.045, 0.045, -0.0854)),
        ((-0.0311, -0.1010, -0.1614), (0.0311, 0.1010, -0.0964)),
    )

    def opening(self, width: float | Float[np.ndarray, "*n"]) -> np.ndarray:
        """How far to open [m] before approaching something of this width [m]."""
        return np.minimum(self.max_opening, np.asarray(width) + 2 * self.clearance)

    def boxes(self, opening: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n boxes 2 3"]:
        """Every box of the hand at these openings [m], in the tcp frame: both fingers', then the hand's."""
        finger = np.array(self.finger)
        turned = np.sort(finger * [-1, -1, 1], axis=1)
        boxes = np.concatenate([finger, turned, np.array(self.hand)])
        outwards = np.zeros(len(boxes))
        outwards[: len(finger)], outwards[len(finger) : 2 * len(finger)] = 0.5, -0.5
        boxes = np.tile(boxes, (len(opening), 1, 1, 1))
        boxes[..., 1] += (outwards * np.asarray(opening)[:, None])[..., None]
        return boxes
