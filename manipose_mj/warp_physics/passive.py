"""Passive forces, with those that bear weight added up by the joint that feels them.

MuJoCo Warp has a lane for each body and degree of freedom, which adds to what all lanes of that degree of freedom add to.
"""

from typing import Any

import mujoco_warp as mjw  # pyright: ignore[reportMissingImports]
import warp as wp  # pyright: ignore[reportMissingImports]
from mujoco_warp._src import passive  # pyright: ignore[reportMissingImports]

_NEITHER = int(mjw.DisableBit.SPRING | mjw.DisableBit.DAMPER)


class PassiveForces:
    """Finds passive forces as `mujoco_warp.passive`."""

    def __init__(self, model: Any, data: Any) -> None:
        """Takes the arrays of both.

        Args:
          model: `mujoco_warp.Model` without soft bodies.
          data: `mujoco_warp.Data`.
        """
        self._model, self._data = model, data
        self._few = not (
            model.has_fluid
            or model.flg_adhesion
            or model.callback.passive
            or model.opt.disableflags & _NEITHER == _NEITHER
        )

    def find(self) -> None:
        """Finds them for the positions and velocities of now."""
        m, d = self._model, self._data
        if not self._few:
            mjw.passive(m, d)
            return
        joints = [m.opt.disableflags, m.qpos_spring, m.jnt_type, m.jnt_qposadr, m.jnt_dofadr]
        joints += [m.jnt_stiffness, m.jnt_stiffnesspoly, m.dof_damping, m.dof_dampingpoly]
        joints += [d.qpos, d.qvel]
        found = [d.qfrc_spring, d.qfrc_damper]
        wp.launch(
            passive._spring_damper_dof_passive, (d.nworld, m.njnt), inputs=joints, outputs=found
        )
        if m.ntendon:
            tendons = [m.ten_J_rownnz, m.ten_J_rowadr, m.ten_J_colind, m.tendon_stiffness]
            tendons += [m.tendon_stiffnesspoly, m.tendon_damping, m.tendon_dampingpoly]
            tendons += [m.tendon_lengthspring, d.ten_J, d.ten_length, d.ten_velocity]
            tendons += [
                m.opt.disableflags & bit for bit in (mjw.DisableBit.SPRING, mjw.DisableBit.DAMPER)
            ]
            exact = bool(m.opt.deterministic & mjw.DeterminismType.ATOMICS)
            kernel = passive._spring_damper_tendon_passive(exact)
            dim = (d.nworld, m.ntendon, m.max_ten_J_rownnz)
            wp.launch(kernel, dim, inputs=tendons, outputs=found)
        weighty = not m.opt.disableflags & mjw.DisableBit.GRAVITY
        bodies = [m.opt.gravity, m.body_rootid, m.body_mass, m.body_gravcomp, m.body_isdofancestor]
        degrees = [m.dof_bodyid, m.dof_jntid, m.jnt_actgravcomp, d.xipos, d.subtree_com, d.cdof]
        wp.launch(
            _add_up,
            (d.nworld, m.nv),
            inputs=[bool(weighty), *bodies, *degrees, *found],
            outputs=[d.qfrc_gravcomp, d.qfrc_passive],
        )


@wp.kernel(enable_backward=False, grid_stride=False)
def _add_up(
    weighty: bool,
    gravity: wp.array[wp.vec3],
    body_root: wp.array[int],
    body_mass: wp.array2d[float],
    body_borne: wp.array2d[float],
    hangs_on: wp.array2d[int],
    dof_body: wp.array[int],
    dof_joint: wp.array[int],
    borne_by_actuator: wp.array[int],
    centres: wp.array2d[wp.vec3],
    origins: wp.array2d[wp.vec3],
    axes: wp.array2d[wp.spatial_vector],
    springs: wp.array2d[float],
    dampers: wp.array2d[float],
    bearing: wp.array2d[float],
    found: wp.array2d[float],
):
    world, dof = wp.tid()
    first = dof_body[dof]
    origin = origins[world, body_root[first]]
    # The weights that this degree of freedom feels, at the origin of its axis, and their lever.
    mass = wp.float32(0.0)
    lever = wp.vec3(0.0)
    if weighty:
        for body in range(first, body_root.shape[0]):
            if hangs_on[body, dof] != 0:
                borne = body_borne[world % body_borne.shape[0], body]
                if borne != 0.0:
                    part = borne * body_mass[world % body_mass.shape[0], body]
                    mass += part
                    lever += part * (centres[world, body] - origin)
    axis = axes[world, dof]
    feels = mass * wp.spatial_bottom(axis) + wp.cross(wp.spatial_top(axis), lever)
    force = -wp.dot(gravity[world % gravity.shape[0]], feels)
    bearing[world, dof] = force
    total = springs[world, dof] + dampers[world, dof]
    if borne_by_actuator[dof_joint[dof]] == 0:
        total += force
    found[world, dof] = total
