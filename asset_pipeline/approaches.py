"""The ways in which the hand can come at a pair of points: turned about their line, near or deep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from asset_pipeline.touch_points import SurfacePoints

TURNS = 24
# Of the pair beyond the pads' centre, towards the tips [m]: the second picks thin things off a table.
DEPTHS = (0.0, 0.0085)
_ANGLES = np.repeat(np.arange(TURNS) * (2 * np.pi / TURNS), len(DEPTHS))
COS, SIN = np.cos(_ANGLES).astype(np.float32), np.sin(_ANGLES).astype(np.float32)
DEPTH = np.tile(np.array(DEPTHS, np.float32), TURNS)
HANDS = len(DEPTH)


@dataclass(frozen=True)
class PairFrames:
    """A frame for each pair, in object coordinates; hand `k` is turned by an angle about `closing`.

    Hand k comes along `COS[k] * first + SIN[k] * other`; the pair lies `DEPTH[k]` beyond its pads'
    centre.

    Attributes:
      center: `(p, 3)` [m], midway.
      axes: `(p, 3, 3)`, rows: first, the approach from above; closing; other.
      half: `(p,)` [m], half the distance along closing.
      slant: `(p,)`, one minus the cosine between closing and either point's normal.
    """

    center: Float[np.ndarray, "p 3"]
    axes: Float[np.ndarray, "p 3 3"]
    half: Float[np.ndarray, "p"]
    slant: Float[np.ndarray, "p"]

    def __len__(self) -> int:
        return len(self.half)

    def take(self, index: Int[np.ndarray, "k"] | slice) -> PairFrames:
        """These of them, in this order."""
        return PairFrames(self.center[index], self.axes[index], self.half[index], self.slant[index])

    def levelled(self, up: Float[np.ndarray, "3"], within: float) -> PairFrames:
        """Those whose closing direction is level to within this sine, turned to be quite level."""
        height = self.axes[:, 1] @ up
        level = np.flatnonzero(np.abs(height) < within)
        closing = self.axes[level, 1] - height[level, None] * up
        closing /= np.linalg.norm(closing, axis=1, keepdims=True)
        first = np.broadcast_to(-up, closing.shape)
        axes = np.stack([first, closing, np.cross(closing, first)], axis=1)
        return PairFrames(self.center[level], axes, self.half[level], self.slant[level])

    def local(self, pair: int, points: Float[np.ndarray, "3 n"]) -> Float[np.ndarray, "3 n"]:
        """Points, given as rows of coordinates, along first, closing and other of one pair [m]."""
        x, y, z = points - self.center[pair].astype(np.float32)[:, None]
        axes = self.axes[pair].astype(np.float32)
        # Written out: a BLAS may add in another order on another machine.
        return np.stack([a[0] * x + a[1] * y + a[2] * z for a in axes])

    def rotations(self, pair: int, hands: Int[np.ndarray, "k"]) -> Float[np.ndarray, "k 3 3"]:
        """Of these hands in the object frame."""
        first, closing, other = self.axes[pair]
        cos, sin = np.cos(_ANGLES[hands])[:, None], np.sin(_ANGLES[hands])[:, None]
        z, x = cos * first + sin * other, cos * other - sin * first
        return np.stack([x, np.broadcast_to(closing, z.shape), z], axis=2)


def pair_frames(
    touch: SurfacePoints, pairs: Int[np.ndarray, "p 2"], ups: Float[np.ndarray, "p 3"]
) -> PairFrames:
    """Frames whose first approach comes as straight from above as the pair allows.

    Args:
      touch: The surface.
      pairs: Indices into it.
      ups: Of the object at rest, one for each pair.
    """
    a, b = touch.points[pairs.T]
    closing = touch.normals[pairs[:, 1]] - touch.normals[pairs[:, 0]]
    length = np.linalg.norm(closing, axis=1)
    closing = closing / length[:, None]
    first = -np.asarray(ups, float)
    level = np.abs((first * closing).sum(axis=1)) > 0.95
    first[level] = np.eye(3)[np.abs(closing[level]).argmin(axis=1)]
    first -= (first * closing).sum(axis=1, keepdims=True) * closing
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return PairFrames(
        center=(a + b) / 2,
        axes=np.stack([first, closing, np.cross(closing, first)], axis=1),
        half=((b - a) * closing).sum(axis=1) / 2,
        slant=1 - length / 2,
    )
