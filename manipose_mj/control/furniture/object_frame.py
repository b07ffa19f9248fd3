"""How a piece of furniture stands: upright, and the way its front faces."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.furniture.part_sensing import SensedFurniture
from manipose_mj.control.furniture.scene_cloud import SceneCloud
from manipose_mj.poses import compose

AJAR = {"slide": 0.015, "hinge": 0.06}  # estimated openings below are none [m, rad]
_SAME_WAY = np.cos(0.1)  # cosine between the ways that two parts face, at least
_UPRIGHT = 0.35  # cosine between normals of walls and the vertical, at most
_WALL = 0.985  # cosine between normals of a wall and the way it faces, at least
_CELL, _BIN = 0.02, 0.005  # in which points are thinned out, and places of walls are counted [m]
_FEWEST = 50  # points of walls that face one way
_TURNS = np.radians(np.arange(-30.0, 30.5, 1.0))  # that are tried
_FINE = np.radians(np.arange(-1.5, 1.55, 0.1))  # and then around the best of them
_NEAR = np.radians(1.5)  # turns no larger than this change nothing
_CLEARLY = 2.0  # how much squarer the walls have to be


def object_pose(cloud: SceneCloud, sensed: SensedFurniture) -> Float[np.ndarray, "4 4"]:
    """`T_world_object`: upright, X out of the front.

    Args:
      cloud: Of the furniture, with normals.
      sensed: Its front and parts.
    """
    # Handles of shut parts know the front better than the body's planes do.
    ways = [sensed.front]
    for part in sensed.parts[:6]:
        way = part.handle[:3, 1] * [1, 1, 0]
        if part.opening < AJAR[part.kind] and way @ sensed.front > _SAME_WAY:
            ways.append(way / np.linalg.norm(way))
    x = np.median(ways, axis=0) if len(ways) > 2 else sensed.front
    x = _square_to_walls(x / np.linalg.norm(x), cloud)
    z = np.array([0.0, 0.0, 1.0])
    rotation = np.stack([x, np.cross(z, x), z], axis=1)
    return compose(rotation, np.median(cloud.points, axis=0))


def _square_to_walls(x: Float[np.ndarray, "3"], cloud: SceneCloud) -> Float[np.ndarray, "3"]:
    """The way the front faces, turned to where front and sides are square to it, if they clearly are not so now.

    A door that stands open is a wall that faces elsewhere, and may be taken for the body's. But it has no second one
    across it.

    Args:
      x: Level and unit.
      cloud: Of the furniture, with normals.
    """
    upright = np.abs(cloud.normals[:, 2]) < _UPRIGHT
    y = np.array([-x[1], x[0], 0.0])
    points, normals = cloud.points[upright], cloud.normals[upright]
    rows = np.unique(np.floor(points / _CELL).astype(int), axis=0, return_index=True)[1]
    flat, faces = (rows_of[rows] @ np.stack([x, y], axis=1) for rows_of in (points, normals))
    scores = np.array([_squareness(flat, faces, turn) for turn in _TURNS])
    now, best = scores[np.abs(_TURNS) <= _NEAR].max(), int(scores.argmax())
    if scores[best] <= _CLEARLY * now:
        return x
    turns = _TURNS[best] + _FINE
    turn = turns[int(np.argmax([_squareness(flat, faces, turn) for turn in turns]))]
    return np.cos(turn) * x + np.sin(turn) * y


def _squareness(
    flat: Float[np.ndarray, "n 2"], faces: Float[np.ndarray, "n 2"], turn: float
) -> float:
    """How much of what faces along a turned axis is in few planes, and of what faces across it: of both, or nothing."""
    way = np.array([np.cos(turn), np.sin(turn)])
    planes = [_in_planes(flat, faces, axis) for axis in (way, np.array([-way[1], way[0]]))]
    return float(np.sqrt(np.prod(planes)))


def _in_planes(
    flat: Float[np.ndarray, "n 2"], faces: Float[np.ndarray, "n 2"], axis: Float[np.ndarray, "2"]
) -> float:
    """Sum of the squares of how many points of walls across an axis are at each place along it."""
    places = flat[np.abs(faces @ axis) > _WALL] @ axis
    if len(places) < _FEWEST:
        return 0.0
    counts = np.histogram(places, np.arange(places.min() - _BIN, places.max() + 2 * _BIN, _BIN))[0]
    return float((np.convolve(counts, [0.5, 1.0, 0.5], mode="same") ** 2).sum())
