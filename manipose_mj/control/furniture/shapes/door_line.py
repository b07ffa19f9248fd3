"""A door that stands open as a line, seen along its hinge."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

# Of the way from the hinge of a door to its free edge, out of the front: with less it stands beside the body rather than before
# it.
_LEADS_OUT = 0.5
_LEAST, _SHORTEST = 200, 0.04  # points on a line; between two that make one [m]
_ON_LINE, _NEAR_LINE = 0.006, 0.012  # how far points are from a line [m]
_TRIES, _SOME = 200, 2000  # lines, and points by which they are judged


@dataclass(frozen=True)
class DoorLine:
    """A door as seen along its hinge. Attributes: middle, a point; way, out of the body; both along X and across `(2,)`;
    inwards: sign of the way from hinge to free edge, across, of the shut door."""

    middle: Float[np.ndarray, "2"]
    way: Float[np.ndarray, "2"]
    inwards: float = 1.0

    @property
    def outwards(self) -> Float[np.ndarray, "2"]:
        """Normal of the face that is the front's when the door is shut."""
        return self.inwards * np.array([self.way[1], -self.way[0]])

    @property
    def opening(self) -> float:
        """Of the door [rad]."""
        return float(np.arctan2(self.way[0], self.way[1] * self.inwards) % (2 * np.pi))

    def before(self, flat: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n"]:
        """How far points are before the line, outwards [m]."""
        return (flat - self.middle) @ self.outwards

    def moved(self, outwards: float) -> DoorLine:
        """The same, further outwards [m]."""
        return DoorLine(self.middle + outwards * self.outwards, self.way, self.inwards)

    def away_from(self, sides: Float[np.ndarray, "2"]) -> DoorLine:
        """The same; where it hardly leads out of the front, the way leads away from the body's sides, across [m]."""
        if abs(self.way[0]) > _LEADS_OUT:
            return self
        away = np.sign(self.middle[1] - sides.mean())
        return replace(self, way=self.way * away * np.sign(self.way[1]))

    def meeting(self, x: float, sides: Float[np.ndarray, "2"]) -> Float[np.ndarray, "2"]:
        """Where it meets the front, which is at `x` [m].

        That is where it comes to a side of the body, if it hardly leads out of the front.
        """
        slope = self.way[1] / self.way[0] if self.way[0] else np.inf
        if abs(self.way[0]) > _LEADS_OUT:
            return np.array([x, self.middle[1] + slope * (x - self.middle[0])])
        side = sides[int(np.abs(sides - self.middle[1]).argmin())]
        return np.array([self.middle[0] + (side - self.middle[1]) / slope, side])


def longest_line(flat: Float[np.ndarray, "n 2"]) -> DoorLine | None:
    """The line that most points are on, its way out of the front; None where they are too few."""
    rng = np.random.default_rng(0)
    first, second = flat[rng.integers(len(flat), size=(2, _TRIES))]
    ways = second - first
    lengths = np.linalg.norm(ways, axis=1)
    long = lengths > _SHORTEST
    if not long.any():
        return None
    first, ways = first[long], ways[long] / lengths[long, None]
    sides = np.column_stack([-ways[:, 1], ways[:, 0]])
    some = flat[rng.integers(len(flat), size=min(len(flat), _SOME))]
    beside = np.abs(np.einsum("kni,ki->kn", some[None] - first[:, None], sides))
    best = int((beside < _ON_LINE).sum(axis=1).argmax())
    on = flat[np.abs((flat - first[best]) @ sides[best]) < _NEAR_LINE]
    middle = on.mean(axis=0)
    way = np.linalg.svd(on - middle, full_matrices=False)[2][0]
    return DoorLine(middle, way if way[0] >= 0 else -way) if len(on) >= _LEAST else None
