"""How a piece of furniture stands: upright, and the way its front faces."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.furniture.sensing.part_sensing import SensedFurniture
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.walls import squareness, walls_of
from manipose_mj.poses import compose

AJAR = {"slide": 0.015, "hinge": 0.06}  # estimated openings below are none [m, rad]
_SAME_WAY = np.cos(0.1)  # cosine between the ways that two parts face, at least
_UPRIGHT = 0.35  # cosine between normals of walls and the vertical, at most
_CELL = 0.02  # in which points are thinned out [m]
_TURNS = np.radians(np.arange(-45.0, 45.05, 0.1))  # that are tried
_NEAR = np.radians(0.5)  # turns no larger than this change nothing
_CLEARLY = 1.3  # how much squarer the walls have to be


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
    lengths = np.maximum(np.linalg.norm(faces, axis=1, keepdims=True), 1e-9)
    walls = walls_of(flat, faces / lengths)
    if not walls:
        return x
    scores = squareness(walls, _TURNS)
    now, best = scores[np.abs(_TURNS) <= _NEAR].max(), int(scores.argmax())
    if scores[best] <= _CLEARLY * now:
        return x
    turn = _TURNS[best]
    return np.cos(turn) * x + np.sin(turn) * y
