"""Which poses of the TCP the arm can take, as a table: an answer for thousands of poses in milliseconds.

Joint 1 turns everything about the base's z, so a pose comes down to five numbers: the distance of the TCP from
that axis, its height, the direction of the approach as seen from there (two) and the turn about it; half a turn
swaps the fingers and does not count. A cell is reachable where some sampled configuration, away from the joint
limits and from singularities, falls into it and into the cells beside it, outwards, inwards, above and below.
Nothing is said about collisions.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

_FILE = Path(__file__).with_name("reachability.npz")
_STEP = 0.05  # of distance and height [m]
_INNER, _LOWEST = 0.20, -0.65  # where the grid begins [m]
_DISTANCES, _HEIGHTS = 14, 37
# Rings of directions about the vertical, and how many directions each has: cells of about one size.
_RINGS = 9
_AROUND = np.maximum(np.round(18 * np.sin((np.arange(_RINGS) + 0.5) * np.pi / _RINGS)), 3).astype(
    int
)
_FIRST = np.concatenate([[0], np.cumsum(_AROUND)[:-1]])
_TURNS = 9
SHAPE = (_DISTANCES, _HEIGHTS, int(_AROUND.sum()), _TURNS)


def reachable_cells() -> Bool[np.ndarray, "distances heights directions turns"]:
    """The table as it is shipped."""
    return _table()


@cache
def _table() -> Bool[np.ndarray, "distances heights directions turns"]:
    with np.load(_FILE) as file:
        bits = np.unpackbits(file["reachable"], count=int(np.prod(SHAPE)))
    table = bits.astype(bool).reshape(SHAPE)
    table.setflags(write=False)
    return table


def is_reachable(tcp_poses: Float[np.ndarray, "*n 4 4"]) -> Bool[np.ndarray, "*n"]:
    """Whether the arm alone can take each pose `T_base_tcp`, with a margin of some centimetres."""
    cells, inside = cells_of(tcp_poses)
    found = _table()[tuple(np.moveaxis(cells, -1, 0))]
    return found & inside


def cells_of(
    tcp_poses: Float[np.ndarray, "*n 4 4"],
) -> tuple[Int[np.ndarray, "*n 4"], Bool[np.ndarray, "*n"]]:
    """The cell of each pose `T_base_tcp`, and whether it is on the grid at all."""
    place = tcp_poses[..., :3, 3]
    out = np.hypot(place[..., 0], place[..., 1])
    cosine, sine = place[..., 0] / np.maximum(out, 1e-9), place[..., 1] / np.maximum(out, 1e-9)
    approach = _unwound(tcp_poses[..., :3, 2], cosine, sine)
    closing = _unwound(tcp_poses[..., :3, 1], cosine, sine)
    ring = _bins(np.arccos(np.clip(approach[..., 2], -1, 1)) / np.pi, _RINGS)
    around = _AROUND[ring]
    share = np.arctan2(approach[..., 1], approach[..., 0]) / (2 * np.pi) + 0.5
    direction = _FIRST[ring] + np.minimum((share * around).astype(int), around - 1)
    # The closing direction once the approach is turned to the nearer vertical the shortest way.
    pole = np.zeros_like(approach)
    pole[..., 2] = np.where(approach[..., 2] < 0, -1.0, 1.0)
    lean = closing[..., 2] * pole[..., 2] / (1 + np.abs(approach[..., 2]))
    level = closing - (approach + pole) * lean[..., None]
    turn = _bins(np.arctan2(level[..., 1], level[..., 0]) / np.pi % 1.0, _TURNS)
    far = np.floor((out - _INNER) / _STEP).astype(int)
    high = np.floor((place[..., 2] - _LOWEST) / _STEP).astype(int)
    inside = (far >= 0) & (far < _DISTANCES) & (high >= 0) & (high < _HEIGHTS)
    cells = np.stack(
        [np.clip(far, 0, _DISTANCES - 1), np.clip(high, 0, _HEIGHTS - 1), direction, turn], axis=-1
    )
    return cells, inside


def with_margin(
    hit: Bool[np.ndarray, "distances heights directions turns"],
) -> Bool[np.ndarray, "distances heights directions turns"]:
    """The cells whose neighbours in distance and height were hit too."""
    padded = np.pad(hit, ((1, 1), (1, 1), (0, 0), (0, 0)))
    beside = padded[2:, 1:-1] & padded[:-2, 1:-1] & padded[1:-1, 2:] & padded[1:-1, :-2]
    return hit & beside


def write_table(cells: Bool[np.ndarray, "distances heights directions turns"]) -> None:
    """Replace the table that is shipped."""
    np.savez_compressed(_FILE, reachable=np.packbits(cells))


def _unwound(
    vectors: Float[np.ndarray, "*n 3"],
    cosine: Float[np.ndarray, "*n"],
    sine: Float[np.ndarray, "*n"],
) -> Float[np.ndarray, "*n 3"]:
    """Vectors in the frame whose x points from the base's axis to the TCP."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=-1)


def _bins(share: Float[np.ndarray, "*n"], count: int) -> Int[np.ndarray, "*n"]:
    return np.minimum((share * count).astype(int), count - 1)
