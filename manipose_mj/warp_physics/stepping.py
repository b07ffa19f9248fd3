"""The physics step of batched worlds: MuJoCo Warp's, with fewer kernels where one does the work of many.

A step of a box's scene is 142 kernels and clearings in MuJoCo Warp, and 64 here; for a few thousand worlds each takes
some microseconds, whatever it does. Gone are those of the solver's iterations (`newton`), those of each level of the
kinematic tree (`trees`), and those that find accelerations without contacts, which `newton` does not need. What is near
each other is found by `collisions`, where things are by `frames`, and what springs, dampers and borne weights exert by
`passive`.
"""

from typing import Any

import mujoco_warp as mjw  # pyright: ignore[reportMissingImports]
import warp as wp  # pyright: ignore[reportMissingImports]
from mujoco_warp._src import forward, smooth  # pyright: ignore[reportMissingImports]

from manipose_mj.warp_physics.collisions import Collisions, can_find
from manipose_mj.warp_physics.frames import Frames
from manipose_mj.warp_physics.newton import NewtonSolver, can_solve
from manipose_mj.warp_physics.passive import PassiveForces
from manipose_mj.warp_physics.trees import subtree_centres, sum_subtrees


class Stepper:
    """Steps all worlds; `step1`, `step2` and `step` are MuJoCo Warp's functions of that name.

    Where `fused` is true, cameras and lights are placed by `mujoco_warp.camlight` alone, and `Data.xfrc_applied` is
    taken for zero.

    Attributes: fused: whether this model is stepped with fewer kernels; others are by MuJoCo Warp's.
    """

    def __init__(self, model: Any, data: Any) -> None:
        """Takes the arrays of both, whose values may change but which must not be replaced afterwards.

        Args:
          model: `mujoco_warp.Model`. Of its options those may change that are arrays, numbers of iterations, and whether
            to begin at the warm start.
          data: `mujoco_warp.Data`.
        """
        self._model, self._data = model, data
        self.fused = _plain(model) and can_solve(model) and can_find(model)
        if self.fused:
            self._solver = NewtonSolver(model, data)
            self._collisions = Collisions(model, data)
            self._frames = Frames(model, data)
            self._passive = PassiveForces(model, data)
            self._armoured = bool(model.ntendon) and bool(model.tendon_armature.numpy().any())
            parents = tuple(model.body_parentid.numpy().tolist())
            self._find_centres = subtree_centres(parents)
            self._sum_inertias = sum_subtrees(parents, into_world=False)
            self._sum_forces = sum_subtrees(parents, into_world=True)

    def step(self) -> None:
        """A whole step."""
        self.step1()
        self.step2()

    def step1(self) -> None:
        """What depends on positions and velocities alone."""
        if not self.fused:
            mjw.step1(self._model, self._data)
            return
        self._find_positions()
        self._find_velocities()

    def step2(self) -> None:
        """What depends on controls, and the state after the step."""
        model, data = self._model, self._data
        if not self.fused:
            mjw.step2(model, data)
            return
        mjw.fwd_actuation(model, data)
        self._solver.solve()
        if model.opt.integrator == mjw.IntegratorType.EULER:
            mjw.euler(model, data)
        else:
            mjw.implicit(model, data)

    def _find_positions(self) -> None:
        """`mujoco_warp.fwd_position`, but for cameras, lights and the factor of the inertia."""
        m, d = self._model, self._data
        self._frames.find()
        masses = [m.body_mass, m.body_subtreemass, _floats(d.xipos)]
        subtrees = [_floats(d.subtree_com)]
        wp.launch(self._find_centres, (d.nworld, 3), inputs=masses, outputs=subtrees)
        bodies = [m.body_rootid, m.body_mass, m.body_inertia, d.xipos, d.ximat, d.subtree_com]
        wp.launch(smooth._cinert, (d.nworld, m.nbody), inputs=bodies, outputs=[d.cinert])
        joints = [m.body_rootid, m.jnt_type, m.jnt_dofadr, m.jnt_bodyid, d.xmat, d.xanchor]
        joints += [d.xaxis, d.subtree_com]
        wp.launch(smooth._cdof, (d.nworld, m.njnt), inputs=joints, outputs=[d.cdof])
        if m.ntendon:
            mjw.tendon(m, d)
        self._sum(self._sum_inertias, d.cinert, d.crb)
        d.M.zero_()
        dofs = [m.dof_bodyid, m.dof_parentid, m.dof_armature, m.M_rownnz, m.M_rowadr, d.cdof, d.crb]
        wp.launch(smooth._M, (d.nworld, m.nv), inputs=dofs, outputs=[d.M])
        if self._armoured:
            smooth.tendon_armature(m, d)
        self._collisions.find()
        mjw.make_constraint(m, d)
        mjw.transmission(m, d)

    def _find_velocities(self) -> None:
        """`mujoco_warp.fwd_velocity`."""
        m, d = self._model, self._data
        moments = [d.qvel, d.moment_rownnz, d.moment_rowadr, d.moment_colind, d.actuator_moment]
        wp.launch(
            forward._actuator_velocity,
            (d.nworld, m.nactuator),
            inputs=moments,
            outputs=[d.actuator_velocity],
        )
        if m.ntendon:
            tendons = [m.ten_J_rownnz, m.ten_J_rowadr, m.ten_J_colind, d.qvel, d.ten_J]
            wp.launch(
                forward._tendon_velocity,
                (d.nworld, m.ntendon),
                inputs=tendons,
                outputs=[d.ten_velocity],
            )
        mjw.com_vel(m, d)
        self._passive.find()
        smooth._rne_cacc_world(m, d)
        smooth._rne_cacc_forward(m, d)
        smooth._rne_cfrc(m, d)
        self._sum(self._sum_forces, d.cfrc_int, d.cfrc_int)
        forces = [m.dof_bodyid, d.cdof, d.cfrc_int]
        wp.launch(smooth._qfrc_bias, (d.nworld, m.nv), inputs=forces, outputs=[d.qfrc_bias])
        if self._armoured:
            smooth.tendon_bias(m, d, d.qfrc_bias)

    def _sum(self, kernel: Any, own: Any, summed: Any) -> None:
        values = _floats(own)
        dim = (values.shape[0], values.shape[2])
        wp.launch(kernel, dim, inputs=[values], outputs=[_floats(summed)])


def _plain(model: Any) -> bool:
    """Whether a model has nothing that `Stepper` leaves out."""
    opt = model.opt
    return not (
        model.nflex
        or model.nsensordata
        or opt.run_rne_postconstraint
        or not opt.run_collision_detection
        or opt.enableflags & mjw.EnableBit.ENERGY
        or model.callback.control
    )


def _floats(array: Any) -> Any:
    """An array of vectors as one of numbers, with a last axis more."""
    length = array.dtype._length_
    return wp.array(
        ptr=array.ptr,
        shape=(*array.shape, length),
        strides=(*array.strides, 4),
        dtype=float,
        device=array.device,
    )
