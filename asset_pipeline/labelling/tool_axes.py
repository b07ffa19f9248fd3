"""Our rule for the axes of functional tools, where the conventions leave a sign open."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def functional_rotation(
    points: Float[np.ndarray, "n 3"],
    grip_point: Float[np.ndarray, "3"],
    x_axis: Float[np.ndarray, "3"],
    mirror_normal: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "3 3"]:
    """The label's axes of a tool whose grip axis and mirror plane are known.

    A tool lies flat on a table and is gripped from above: Y is the thinner of the two directions
    across X, the mirror plane's normal or the one in the plane. Along the normal, its sign is the one
    for which Z points to where the shape reaches farther from the grip axis (a knife's edge); in the
    plane, it points away from there (a spoon's bowl dips below its handle).

    Args:
      points: Of the surface, at least its convex hull's corners, in the mesh frame [m].
      grip_point: `(3,)` [m], any point of the grip axis.
      x_axis: `(3,)`, unit, along the grip axis from grip to functional area.
      mirror_normal: `(3,)`, the normal of the mirror plane that contains X; its sign does not count.

    Returns:
      Columns X, Y, Z in the mesh frame.
    """
    normal = mirror_normal - (mirror_normal @ x_axis) * x_axis
    normal = normal / np.linalg.norm(normal)
    in_plane = np.cross(normal, x_axis)
    across = (points - grip_point) @ np.stack([normal, in_plane], axis=1)
    farther = in_plane if across[:, 1].max() >= -across[:, 1].min() else -in_plane
    along_normal, along_plane = np.ptp(across, axis=0)
    y = np.cross(farther, x_axis) if along_normal <= along_plane else -farther
    return np.stack([x_axis, y, np.cross(x_axis, y)], axis=1)
