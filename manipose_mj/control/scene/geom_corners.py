"""Points that span the geoms of a body."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from manipose_mj.poses import compose, transform

_ROUND = 16  # points around what is round


def geom_corners(model: mujoco.MjModel, geom: int) -> Float[np.ndarray, "v 3"]:
    """Points whose convex hull is a geom, of round ones nearly, in its body's frame [m]."""
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    pose = compose(rotation.reshape(3, 3), model.geom_pos[geom].copy())
    return transform(pose, _corners(model, geom))


def _corners(model: mujoco.MjModel, geom: int) -> Float[np.ndarray, "v 3"]:
    """The same in the geom's frame [m]."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        return model.mesh_vert[first : first + count].astype(float)
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return signs * size
    angle = np.linspace(0, 2 * np.pi, _ROUND, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1) * size[0]
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        levels = [(1.0, -size[1]), (1.0, size[1])]
    else:
        half = float(size[1]) if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0
        tilts = np.linspace(-np.pi / 2, np.pi / 2, 9)
        levels = [(np.cos(t), np.sign(t) * half + np.sin(t) * size[0]) for t in tilts]
        if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            unit = np.concatenate(
                [np.column_stack([circle / size[0] * np.cos(t), np.full(_ROUND, np.sin(t))]) for t in tilts]
            )  # fmt: skip
            return unit * size
    return np.concatenate(
        [np.column_stack([circle * share, np.full(_ROUND, height)]) for share, height in levels]
    )
