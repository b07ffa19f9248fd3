"""Upright planes of a cloud, seen from above: lines, each with the way it faces and how much of it shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

_TRIES, _SOME = 150, 1500  # pairs of points that make a line, and points by which it is judged
_THICK = 0.008  # how far points of a wall are from its line [m]
_FACES = 0.94  # cosine between their normals and the line's, at least
_LEAST, _SHORTEST = 25, 0.06  # points of a wall, and its length [m]
_MOST = 10  # walls
_ALIKE = np.radians(1.2)  # how precisely angles of walls are known
_SEED = 0


@dataclass(frozen=True)
class Wall:
    """Attributes: angle: of the way it faces, from 0 to a half turn [rad]; size: number of points."""

    angle: float
    size: int


def walls_of(flat: Float[np.ndarray, "n 2"], faces: Float[np.ndarray, "n 2"]) -> list[Wall]:
    """The largest walls, one after the other without the points of those before.

    Args:
      flat: Points of what is upright, from above, thinned out [m].
      faces: Their normals.
    """
    rng = np.random.default_rng(_SEED)
    walls: list[Wall] = []
    while len(walls) < _MOST and len(flat) >= _LEAST:
        on = _largest(flat, faces, rng)
        if on.sum() < _LEAST:
            break
        middle = flat[on].mean(axis=0)
        way = np.linalg.svd(flat[on] - middle, full_matrices=False)[2][0]
        normal = np.array([-way[1], way[0]])
        normal *= 1.0 if faces[on].mean(axis=0) @ normal > 0 else -1.0
        on = _on_line(flat, faces, middle, normal)
        if on.sum() >= _LEAST and np.ptp((flat[on] - middle) @ way) > _SHORTEST:
            walls.append(Wall(float(np.arctan2(way[0], -way[1]) % np.pi), int(on.sum())))
        elif not on.any():
            break
        flat, faces = flat[~on], faces[~on]
    return walls


def squareness(walls: list[Wall], angles: Float[np.ndarray, "k"]) -> Float[np.ndarray, "k"]:
    """How much there is of walls that face along an angle and of walls that face across it: of both, or nothing.

    Args:
      walls: All that show.
      angles: To judge [rad].
    """
    sizes = np.array([wall.size for wall in walls], float)
    facing = np.array([wall.angle for wall in walls])
    both = [
        np.exp(-((_between(facing[None], across) / _ALIKE) ** 2)) @ sizes
        for across in (angles[:, None], angles[:, None] + np.pi / 2)
    ]
    return np.sqrt(both[0] * both[1])


def _between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """From angles of lines to others, the short way round [rad]."""
    return (one - other + np.pi / 2) % np.pi - np.pi / 2


def _largest(
    flat: Float[np.ndarray, "n 2"], faces: Float[np.ndarray, "n 2"], rng: np.random.Generator
) -> Bool[np.ndarray, "n"]:
    """The points of the wall through two of them that has most."""
    some = rng.integers(len(flat), size=min(len(flat), _SOME))
    first, second = rng.integers(len(flat), size=(2, _TRIES))
    best, most = np.zeros(len(flat), bool), 0
    for start, end, face in zip(flat[first], flat[second], faces[first], strict=True):
        way = end - start
        length = float(np.linalg.norm(way))
        if length < _SHORTEST:
            continue
        normal = np.array([-way[1], way[0]]) / length
        normal *= 1.0 if face @ normal > 0 else -1.0
        count = int(_on_line(flat[some], faces[some], start, normal).sum())
        if count > most:
            best, most = _on_line(flat, faces, start, normal), count
    return best


def _on_line(
    flat: Float[np.ndarray, "n 2"],
    faces: Float[np.ndarray, "n 2"],
    place: Float[np.ndarray, "2"],
    normal: Float[np.ndarray, "2"],
) -> Bool[np.ndarray, "n"]:
    """Points of one side of a wall, the one that faces along the normal."""
    return (np.abs((flat - place) @ normal) < _THICK) & (faces @ normal > _FACES)
