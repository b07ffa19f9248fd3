"""What is printed on the dial of a clock."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.moulded import printed, rectangle
from asset_pipeline.procedural.solids import ellipse
from asset_pipeline.procedural.specimen import Colour
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import compose, rotation_about

RED: Colour = (0.80, 0.14, 0.12, 1.0)
TAIL = 0.12  # how far a hand reaches past the middle, as a share of the radius
# Length and half width as shares of the radius: of quarter and other marks, of hour and minute hand.
QUARTER, OTHER = (0.17, 0.030), (0.11, 0.018)
HOUR_HAND, MINUTE_HAND = (0.50, 0.045), (0.74, 0.032)


def dial_prints(
    face: Float[np.ndarray, "4 4"],
    radius: float,
    time: tuple[int, int],
    rgba: Colour,
    *,
    first_layer: int,
) -> list[Shape]:
    """Twelve marks, two hands and a red cap over their axle.

    Args:
      face: `T_body_face` of the dial's middle, z towards the reader and y to twelve.
      radius: Of the dial [m].
      time: Hour and minute shown.
      rgba: Of marks and hands.
      first_layer: The layer of the marks; the others lie above.
    """
    hour, minute = time
    shapes = []

    def put(part: tuple[float, float], turn: float, start: float, layer: int) -> None:
        length, half = part
        spin = compose(rotation_about(np.array([0.0, 0.0, 1.0]), -turn), np.zeros(3))
        spin[:3, 3] = spin[:3, :3] @ [0.0, (start + length / 2) * radius, 0.0]
        outline = rectangle(half * radius, length / 2 * radius)
        shapes.append(printed(outline, face @ spin, rgba, layer))

    for k in range(12):
        mark = QUARTER if k % 3 == 0 else OTHER
        put(mark, k * np.pi / 6, 0.945 - mark[0], first_layer)
    turns = ((hour + minute / 60) * np.pi / 6, minute * np.pi / 30)
    for level, (hand, turn) in enumerate(zip((HOUR_HAND, MINUTE_HAND), turns, strict=True), 1):
        put((hand[0] + TAIL, hand[1]), turn, -TAIL, first_layer + level)
    cap = ellipse((0.07 * radius, 0.07 * radius), 16)
    return [*shapes, printed(cap, face, RED, first_layer + 4)]
