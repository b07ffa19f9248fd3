"""The ways in which the hand can come at a pair of points: turned about their line, near or deep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from manipose_mj.grasp_sampling.touch_points import SurfacePoints

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

    def local(self, chosen: slice, points: Float[np.ndarray, "3 n"]) -> Float[np.ndarray, "3 p n"]:
        """Points, given as rows of coordinates, along first, closing and other of these pairs [m]."""
        centers = self.center[chosen].T.astype(np.float32)
        offsets = [row - center[:, None] for row, center in zip(points, centers, strict=True)]
        axes = self.axes[chosen].transpose(1, 2, 0).astype(np.float32)
        return np.stack([_along(axis[..., None], offsets) for axis in axes])

    def local_within(
        self, pair: int, points: Float[np.ndarray, "3 n"], reach: tuple[float, float, float]
    ) -> tuple[Float[np.ndarray, "3 k"], Int[np.ndarray, "k"]]:
        """Those points that lie within `reach` along the three axes of one pair, and their indices."""
        center = self.center[pair].astype(np.float32)
        offsets = [row - middle for row, middle in zip(points, center, strict=True)]
        local = [_along(axis, offsets) for axis in self.axes[pair].astype(np.float32)]
        near = np.abs(local[0]) < reach[0]
        for row, far in zip(local[1:], reach[1:], strict=True):
            near &= np.abs(row) < far
        index = np.flatnonzero(near)
        return np.stack([row.take(index) for row in local]), index

    def rotations(self, pair: int, hands: Int[np.ndarray, "k"]) -> Float[np.ndarray, "k 3 3"]:
        """Of these hands in the object frame."""
        first, closing, other = self.axes[pair]
        cos, sin = np.cos(_ANGLES[hands])[:, None], np.sin(_ANGLES[hands])[:, None]
        z, x = cos * first + sin * other, cos * other - sin * first
        return np.stack([x, np.broadcast_to(closing, z.shape), z], axis=2)


def _along(axis: np.ndarray, offsets: Sequence[np.ndarray]) -> np.ndarray:
    """Written out: a BLAS may add in another order on another machine."""
    total = axis[0] * offsets[0]
    total += axis[1] * offsets[1]
    total += axis[2] * offsets[2]
    return total


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
