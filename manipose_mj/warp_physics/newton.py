"""The constraint solver of batched worlds: one kernel, in which a warp of the GPU solves a world from beginning to end.

MuJoCo Warp solves with ten kernels an iteration, for all worlds as often as one of them needs it. Objective,
tolerances and result are the same here; the code is in `newton.cuh`. See `docs/experiments/batched_worlds.md`.
"""

from functools import cache
from importlib.resources import files
from typing import Any

import mujoco_warp as mjw  # pyright: ignore[reportMissingImports]
import warp as wp  # pyright: ignore[reportMissingImports]
from mujoco_warp._src.types import (  # pyright: ignore[reportMissingImports]
    ConstraintState,
    ConstraintType,
    vec5,
)

MOST_DOFS = 32  # a lane of the warp each
_WORLDS = 2  # in a block


@wp.struct
class Problem:
    """Arrays and options of MuJoCo Warp that the solver reads and writes, and its own scratch."""

    iterations: int
    ls_iterations: int
    warm: bool
    tolerance: wp.array[float]
    ls_tolerance: wp.array[float]
    impratio_invsqrt: wp.array[float]
    row_count: wp.array[int]
    row_address: wp.array[int]
    column_index: wp.array[int]
    equalities: wp.array[int]
    frictions: wp.array[int]
    nefc: wp.array[int]
    packed_inertia: wp.array2d[float]
    qfrc_passive: wp.array2d[float]
    qfrc_bias: wp.array2d[float]
    qfrc_actuator: wp.array2d[float]
    qfrc_applied: wp.array2d[float]
    warm_start: wp.array2d[float]
    contact_dim: wp.array[int]
    contact_friction: wp.array[vec5]
    contact_address: wp.array2d[int]
    row_type: wp.array2d[int]
    row_id: wp.array2d[int]
    jacobian: wp.array3d[float]
    stiffness: wp.array2d[float]
    aref: wp.array2d[float]
    frictionloss: wp.array2d[float]
    jaref_scratch: wp.array2d[float]
    jv_scratch: wp.array2d[float]
    qfrc_smooth: wp.array2d[float]
    row_force: wp.array2d[float]
    row_state: wp.array2d[int]
    inertial_force: wp.array2d[float]
    qacc: wp.array2d[float]
    qfrc_constraint: wp.array2d[float]
    iterations_taken: wp.array[int]
    overflow: wp.array[int]


class NewtonSolver:
    """Finds what `mujoco_warp.fwd_acceleration` and `mujoco_warp.solve` find, but for `Data.qacc_smooth`.

    `Data.xfrc_applied` is taken for zero.
    """

    def __init__(self, model: Any, data: Any) -> None:
        """Takes the arrays of both, and room for scratch.

        Args:
          model: `mujoco_warp.Model` that `can_solve`.
          data: `mujoco_warp.Data`.
        """
        self._model, self._data = model, data
        self._kernel = _kernel(model.nv, max(1, int(model.nmaxcondim)))
        efc, contact, problem = data.efc, data.contact, Problem()
        problem.row_count, problem.row_address = model.M_rownnz, model.M_rowadr
        problem.column_index, problem.packed_inertia = model.M_colind, data.M
        problem.equalities, problem.frictions, problem.nefc = data.ne, data.nf, data.nefc
        for name in (
            *("qfrc_passive", "qfrc_bias", "qfrc_actuator", "qfrc_applied", "qfrc_smooth"),
            *("qfrc_constraint", "qacc", "overflow"),
        ):
            setattr(problem, name, getattr(data, name))
        problem.warm_start, problem.iterations_taken = data.qacc_warmstart, data.solver_niter
        problem.contact_dim, problem.contact_friction = contact.dim, contact.friction
        problem.contact_address = contact.efc_address
        problem.row_type, problem.row_id, problem.jacobian = efc.type, efc.id, efc.J
        problem.stiffness, problem.aref, problem.frictionloss = efc.D, efc.aref, efc.frictionloss
        problem.row_force, problem.row_state, problem.inertial_force = efc.force, efc.state, efc.Ma
        problem.jaref_scratch = wp.empty((data.nworld, data.njmax), dtype=float)
        problem.jv_scratch = wp.empty((data.nworld, data.njmax), dtype=float)
        self._problem = problem

    def solve(self) -> None:
        """Accelerations and constraint forces."""
        opt, problem = self._model.opt, self._problem
        problem.iterations, problem.ls_iterations = opt.iterations, opt.ls_iterations
        problem.warm = not opt.disableflags & mjw.DisableBit.WARMSTART
        problem.tolerance, problem.ls_tolerance = opt.tolerance, opt.ls_tolerance
        problem.impratio_invsqrt = opt.impratio_invsqrt
        wp.launch(
            self._kernel,
            dim=(self._data.nworld, MOST_DOFS),
            block_dim=_WORLDS * MOST_DOFS,
            inputs=[problem],
        )


def can_solve(model: Any) -> bool:
    """Whether `NewtonSolver` does what MuJoCo Warp does for a `mujoco_warp.Model`."""
    opt = model.opt
    return (
        0 < model.nv <= MOST_DOFS
        and not model.is_sparse
        and opt.solver == mjw.SolverType.NEWTON
        and opt.integrator in (mjw.IntegratorType.EULER, mjw.IntegratorType.IMPLICITFAST)
        and not opt.noslip_iterations
        and not opt.enableflags & mjw.EnableBit.SLEEP
    )


@cache
def _kernel(nv: int, most_rows: int) -> Any:
    """For so many degrees of freedom, and rows of a contact."""
    states, limits = ConstraintState, mjw.OverflowType
    constants = {
        "NV": nv,
        "MOST_ROWS": most_rows,
        "WORLDS": _WORLDS,
        "ELLIPTIC": ConstraintType.CONTACT_ELLIPTIC,
        **{s.name: s for s in states},
        **{s.name: s for s in (limits.ITERATIONS, limits.LS_ITERATIONS)},
    }
    head = "".join(f"constexpr int {name} = {int(value)};\n" for name, value in constants.items())
    body = files("manipose_mj.warp_physics").joinpath("newton.cuh").read_text(encoding="utf-8")

    @wp.func_native(head + body)
    def solve_world(world: int, thread: int, problem: Problem): ...

    @wp.kernel(
        module="unique",
        enable_backward=False,
        grid_stride=False,
        module_options={"fast_math": True},
    )
    def solve(problem: Problem):
        """A world by each 32 threads."""
        world, thread = wp.tid()
        solve_world(world, thread, problem)

    return solve
