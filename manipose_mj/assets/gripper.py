"""The geometry of a parallel-jaw hand, as far as grasp sampling needs it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.franka_hand import (
    FINGER_BOXES,
    FINGER_OFFSET,
    GRIP_FORCE,
    HAND_BOXES,
    MAX_OPENING,
    PAD_BOX,
    PAD_HALF_HEIGHT,
    PAD_HALF_WIDTH,
    TCP_OFFSET,
    Box,
)


def _in_tcp_frame(box: Box, offset: float) -> Box:
    """A box of a frame that lies `offset` [m] along the hand's z, rounded to a micrometre."""
    low, high = ((x, y, round(z + offset - TCP_OFFSET, 6)) for x, y, z in box)
    return low, high


_FINGERS = tuple(_in_tcp_frame(box, FINGER_OFFSET) for box in (PAD_BOX, *FINGER_BOXES[::-1]))
_BODY, _FLANGE, _PLUG = (_in_tcp_frame(box, 0.0) for box in HAND_BOXES)


@dataclass(frozen=True)
class ParallelJaw:
    """A two-finger hand in its tcp frame; the defaults are the Franka hand's.

    z points out of the hand, y is the closing direction, the origin lies midway between the pads'
    centres. Boxes are (lower corner, upper corner) [m]. The finger's are those of the finger at +y, measured from
    its pad's face (y = 0 there); the other finger is its half turn about z.

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

    max_opening: float = MAX_OPENING
    pad_half_width: float = PAD_HALF_WIDTH
    pad_half_height: float = PAD_HALF_HEIGHT
    clearance: float = 0.006
    min_clearance: float = 0.003
    grip_force: float = GRIP_FORCE
    finger: tuple[Box, ...] = _FINGERS
    hand: tuple[Box, ...] = (
        _BODY,
        _FLANGE,
        (_PLUG[0], (_PLUG[1][0], -_PLUG[0][1], _PLUG[1][2])),
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
