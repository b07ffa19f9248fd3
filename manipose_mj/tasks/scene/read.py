"""Reads the state of a scene from the simulator's arrays: a pure function, of NumPy or JAX."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.poses import Array, compose, namespace
from manipose_mj.small_matrices import product
from manipose_mj.tasks.scene.indices import LEFT_PAD, RIGHT_PAD, SceneIndices, SceneShapes
from manipose_mj.tasks.scene.state import ObjectState, PartState, SceneState


class PhysicsArrays(NamedTuple):
    """What of MuJoCo's data a scene's state depends on; as of the last forward kinematics.

    Attributes:
      qpos, qvel: Joint positions and velocities.
      xpos, xmat: Of the bodies.
      site_xpos, site_xmat: Of the sites.
      contact_geoms: Both geoms of each contact.
      contact_valid: Which of these rows are contacts now; all without it.
    """

    qpos: Float[Array, "*b nq"]
    qvel: Float[Array, "*b nv"]
    xpos: Float[Array, "*b bodies 3"]
    xmat: Float[Array, "*b bodies 3 3"]
    site_xpos: Float[Array, "*b sites 3"]
    site_xmat: Float[Array, "*b sites 3 3"]
    contact_geoms: Int[Array, "*b contacts 2"]
    contact_valid: Bool[Array, "*b contacts"] | None = None


def read(indices: SceneIndices, shapes: SceneShapes, data: PhysicsArrays) -> SceneState:
    """The state of the objects and parts that `indices` names.

    Args:
      indices: Of the model that the arrays belong to.
      shapes: In the same order; what differs between worlds has batch dimensions.
      data: Of the simulator.
    """
    xp = namespace(data.qpos)
    bodies = compose(data.xmat[..., indices.bodies, :, :], data.xpos[..., indices.bodies, :])
    frames = _each(product(bodies, shapes.frames), 2)
    velocities = data.qvel[..., indices.speeds]
    speeds = _each(xp.sqrt(xp.vecdot(velocities, velocities)), 1)
    openings = _each(data.qpos[..., indices.openings]) if indices.parts else []
    touched, held = map(_each, touching(indices, data.contact_geoms, data.contact_valid))
    count, handles = len(indices.objects), len(indices.objects) + len(indices.parts)
    objects, parts = {}, {}
    for i, name in enumerate(indices.objects):
        linear_speed, angular_speed = _each(speeds[i])
        objects[name] = ObjectState(
            extents=shapes.extents[..., i, :],
            center=shapes.centers[..., i, :],
            symmetry=shapes.symmetries[i],
            label_pose=frames[i],
            linear_speed=linear_speed,
            angular_speed=angular_speed,
            touched=touched[i],
            held=held[i],
        )
    for i, name in enumerate(indices.parts):
        parts[name] = PartState(
            range=shapes.ranges[..., i, :],
            cavity_extents=shapes.cavity_extents[..., i, :],
            has_cavity=shapes.has_cavity[..., i],
            opening=openings[i],
            handle_pose=frames[count + i],
            cavity_pose=frames[handles + i],
            touched=touched[count + i],
        )
    tcp, (one, other) = indices.tcp, indices.fingers
    return SceneState(
        tcp_pose=compose(data.site_xmat[..., tcp, :, :], data.site_xpos[..., tcp, :]),
        gripper=data.qpos[..., one] + data.qpos[..., other],
        objects=objects,
        parts=parts,
    )


def touching(
    indices: SceneIndices,
    geoms: Int[Array, "*b contacts 2"],
    valid: Bool[Array, "*b contacts"] | None = None,
) -> tuple[Bool[Array, "*b n"], Bool[Array, "*b n"]]:
    """Which objects, then parts, the robot touches, and which it holds between its pads.

    Args:
      indices: Of the model.
      geoms: Both of each contact.
      valid: Which rows are contacts; all without it.
    """
    xp = namespace(geoms)
    none = xp.zeros((*geoms.shape[:-2], len(indices.owned)), dtype=bool)
    if not geoms.shape[-2]:  # as most of the time: none are computed between bodies asleep
        return none, none
    owners = xp.asarray(indices.owners)[geoms]
    robots = owners <= RIGHT_PAD
    if valid is not None:
        robots = robots & valid[..., None]
    if xp is np and not robots.any():
        return none, none
    meets = xp.flip(owners, axis=-1)[..., None] == xp.asarray(indices.owned)

    def met_by(side: Bool[Array, "*b contacts 2"]) -> Bool[Array, "*b n"]:
        return xp.any(meets & side[..., None], axis=(-3, -2))

    left, right = (met_by(robots & (owners == pad)) for pad in (LEFT_PAD, RIGHT_PAD))
    return met_by(robots), left & right


def _each(array: Array, inner: int = 0) -> list[Array]:
    """The entries along the axis before the `inner` last ones; quick to compute with, as scalars are."""
    if array.ndim == inner + 1:
        return list(array)
    after = (slice(None),) * inner
    return [array[(..., i, *after)] for i in range(array.shape[-1 - inner])]
