"""The engine `warp`: MuJoCo Warp called from JAX, one captured graph a control step."""

from dataclasses import fields, is_dataclass
from math import ceil
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import mujoco_warp  # pyright: ignore[reportMissingImports]
import numpy as np
import warp as wp  # pyright: ignore[reportMissingImports]
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.batch.capacity import Capacity, kept_probe
from manipose_mj.batch.kernels import warp_kernels as kernels
from manipose_mj.batch.kernels.kernels_ahead import begin_compiling
from manipose_mj.batch.measurement import Measurement
from manipose_mj.batch.render_warp import WarpRenderer
from manipose_mj.batch.row_fields import RowFields
from manipose_mj.batch.starts import StartPool
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.mjcf.panda.speed_limits import JOINT_LEADS, TCP_LEAD, most_motion
from manipose_mj.poses import Array
from manipose_mj.warp_physics.stepping import Stepper

Physics = dict[str, Array]
_FASTEST = 1e3  # nothing in a scene moves at this speed [m/s, rad/s]; what does has diverged
# Captured steps of MuJoCo Warp hold several times what the data do (measured: 3.2 and 3.9 times).
_SCRATCH = 4
_DRY_CONTACTS, _DRY_CONSTRAINTS = 64, 400  # room that nothing is computed in
_MOVING = ("qpos", "qvel", "ctrl", "qacc_warmstart")  # the state of a world
# What measurements are made of, as MuJoCo's data have them.
_READ = ("xpos", "xmat", "site_xpos", "site_xmat", "cam_xpos", "cam_xmat", "actuator_force")


class WarpEngine:
    """All worlds in one `mujoco_warp.Data`, which is scratch: states are arguments and results.

    Attributes: capacity: room for contacts and constraints.
    """

    name = "warp"

    def __init__(
        self,
        pool: StartPool,
        worlds: int,
        capacity: Capacity | None = None,
        *,
        visual: bool = False,
        dry: bool = False,
    ) -> None:
        """Copies the model to the device and compiles the kernels.

        Args:
          pool: Of starts.
          worlds: How many there are.
          capacity: Room for contacts and constraints; None: from a `kept_probe` of the pool.
          visual: Whether cameras shall see the objects and furniture of several scenes.
          dry: Launch what a step launches and no more, to find out what it is.

        Raises:
          InputError: The pool has several scenes that no model can stand for, or the device has too little memory.
        """
        self._pool, self._worlds = pool, worlds
        self._fields = RowFields(pool, visual=visual)
        self._visual = visual or len(pool.scenes) == 1
        model = self._fields.model
        self._device = wp.device_from_jax(jax.devices()[0])
        compiling = None
        if self._device.is_cuda and not dry:
            # One kernel depends on the room: it is compiled below.
            likeness = f"{_likeness(model)} {visual}"
            compiling = begin_compiling(dry_engine, (pool, visual), self._device.arch, likeness)
        self.capacity = capacity or kept_probe(pool).capacity(worlds)
        with wp.ScopedDevice(self._device):
            self._model = mujoco_warp.put_model(model)
            self._model.opt.warn_overflow = 0  # it is reported, not printed
            self._require_room(model)
            self._data = self._made(model, worlds)
            self._tables = self._fields.to_device(self._model, self._data, worlds)
            self._stepper = Stepper(self._model, self._data)
            self._prepare_robot(model)
            self._rows = wp.full(worlds, -1, dtype=int)
            self._changed = wp.zeros(worlds, dtype=int)
            self._owners = wp.array(self._fields.owners, dtype=int)
        self._owned = len(pool.layout.objects) + len(pool.layout.parts)
        self._addresses = jax.tree.map(jnp.asarray, self._fields.addresses)
        if compiling is not None:
            compiling.wait()
        self._warm_up()
        self._call: Any = None if dry else self._compiled()

    def _made(self, model: mujoco.MjModel, worlds: int) -> Any:
        """Data of so many worlds, each with its share of the room."""
        room = self.capacity
        return mujoco_warp.make_data(
            model,
            nworld=worlds,
            naconmax=ceil(room.contacts * worlds),
            njmax=room.constraints,
        )

    def _require_room(self, model: mujoco.MjModel) -> None:
        """Raises InputError where the device has less memory than the worlds take."""
        if not self._device.is_cuda:
            return
        needed = _SCRATCH * _size(self._made(model, 1)) * self._worlds
        free = self._device.free_memory
        if needed > free:
            raise InputError(
                f"{self._worlds} worlds of this task take about {needed / 1e9:.0f} GB of the device; "
                f"{free / 1e9:.0f} GB are free: make fewer"
            )

    def starts(self) -> Physics:
        return {name: jnp.asarray(v, jnp.float32) for name, v in self._fields.states.items()} | {
            "overflow": jnp.zeros(len(self._pool.starts), jnp.int32)
        }

    def advance(
        self,
        physics: Physics,
        rows: Int[Array, " worlds"],
        targets: Float[Array, "worlds substeps 8"],
    ) -> tuple[Physics, Bool[Array, " worlds"], Measurement]:
        found = self._call(rows, targets, *(physics[name] for name in _MOVING))
        names: tuple[str, ...] = (*_MOVING, *_READ, "contacts", "diverged", "overflow")
        after = {name: array for name, array in zip(names, found, strict=True)}
        kept = {name: after[name] for name in _MOVING}
        kept["overflow"] = physics["overflow"] | after["overflow"]
        return kept, after["diverged"] > 0, self._measured(rows, after)

    def overflowed(self, physics: Physics) -> Bool[Array, " worlds"]:
        return physics["overflow"] != 0

    def renderer(
        self, cameras: tuple[str, ...], height: int, width: int, rgb: bool
    ) -> WarpRenderer:
        if not self._visual:
            raise InputError(
                "these worlds have no visual shapes: make them with visual=True for their cameras"
            )
        return WarpRenderer(
            self._fields.model,
            self._model,
            self._data,
            self._take_starts,
            cameras,
            (height, width),
            rgb,
        )

    def scene_geoms(self, row: int) -> Int[np.ndarray, " geoms"]:
        return self._fields.geoms[self._pool.starts[row].scene]

    def close(self) -> None:
        wp.clear_jax_callable_graph_cache(self._call)

    def _measured(self, rows: Int[Array, " worlds"], now: dict[str, Array]) -> Measurement:
        """Of the simulator's arrays, what each world's start says."""
        at, servos = self._addresses, self._pool.starts[0].addresses.servos

        def each(array: Array, index: Array) -> Array:
            return jax.vmap(lambda values, chosen: values[chosen])(array, index[rows])

        qpos, qvel = now["qpos"], now["qvel"]
        return Measurement(
            joints=qpos[:, servos.angles],
            velocities=qvel[:, servos.dofs],
            torques=now["actuator_force"][:, servos.arm],
            fingers=qpos[:, servos.fingers],
            tcp_position=now["site_xpos"][:, servos.tcp],
            tcp_rotation=now["site_xmat"][:, servos.tcp],
            positions=each(now["xpos"], at["bodies"]),
            rotations=each(now["xmat"], at["bodies"]),
            speeds=each(qvel, at["dofs"][..., None] + jnp.arange(6)),
            openings=each(qpos, at["openings"]),
            contacts=now["contacts"].reshape(self._worlds, 3, self._owned) > 0,
            camera_positions=each(now["cam_xpos"], at["cameras"]),
            camera_rotations=each(now["cam_xmat"], at["cameras"]),
        )

    def _prepare_robot(self, model: mujoco.MjModel) -> None:
        servos = self._pool.starts[0].addresses.servos
        angles = np.arange(servos.angles.start, servos.angles.stop)
        joints = [int(np.flatnonzero(model.jnt_qposadr == a)[0]) for a in angles]
        limits = np.stack(
            [most_motion(model.opt.timestep), JOINT_LEADS, *POSITION_LIMITS.T], axis=1
        )
        self._joints = wp.array(np.array(joints), dtype=int)
        self._angles = wp.array(angles, dtype=int)
        self._limits = wp.array(limits, dtype=float)
        self._servos = servos

    def _step(self, targets: Any) -> None:
        """The physics steps of one control step; nothing is read back from the device."""
        data, servos, stepper = self._data, self._servos, self._stepper
        stepper.step1()
        for substep in range(self._pool.layout.substeps):
            wp.launch(
                kernels.limit_set_points,
                dim=self._worlds,
                inputs=[
                    targets,
                    substep,
                    data.qpos,
                    data.site_xpos,
                    data.xanchor,
                    data.xaxis,
                    self._joints,
                    self._angles,
                    self._limits,
                    servos.tcp,
                    servos.arm.start,
                    servos.gripper,
                    float(TCP_LEAD),
                    float(MAX_OPENING),
                ],
                outputs=[data.ctrl],
            )
            # The second half of a step, then the first of the next, as the CPU's environment steps.
            stepper.step2()
            stepper.step1()
        mujoco_warp.camlight(self._model, data)

    def _take_starts(self, rows: Any) -> None:
        """Where a world's start is another one than before, give the model the fields of that."""
        changed = self._changed
        wp.launch(kernels.find_changed, self._worlds, inputs=[rows], outputs=[self._rows, changed])
        for table, field in self._tables:
            kernel = kernels.copy_integers if table.dtype == wp.int32 else kernels.copy_reals
            wp.launch(kernel, field.shape, inputs=[rows, changed, table], outputs=[field])

    def _read(self, rows: Any, contacts: Any, diverged: Any) -> None:
        data = self._data
        contacts.zero_()
        wp.launch(
            kernels.find_contacts,
            dim=data.naconmax,
            inputs=[
                data.nacon,
                data.contact.worldid,
                data.contact.geom,
                rows,
                self._owners,
                self._owned,
            ],
            outputs=[contacts],
        )
        wp.launch(
            kernels.find_diverged,
            dim=self._worlds,
            inputs=[data.qpos, data.qvel, _FASTEST],
            outputs=[diverged],
        )

    def _compiled(self) -> Any:
        """The control step as a function that JAX can call."""
        data = self._data

        def control_step(
            rows: wp.array[int],
            targets: wp.array3d[float],
            qpos: wp.array2d[float],
            qvel: wp.array2d[float],
            ctrl: wp.array2d[float],
            qacc_warmstart: wp.array2d[float],
            qpos_after: wp.array2d[float],
            qvel_after: wp.array2d[float],
            ctrl_after: wp.array2d[float],
            qacc_warmstart_after: wp.array2d[float],
            xpos: wp.array2d[wp.vec3],
            xmat: wp.array2d[wp.mat33],
            site_xpos: wp.array2d[wp.vec3],
            site_xmat: wp.array2d[wp.mat33],
            cam_xpos: wp.array2d[wp.vec3],
            cam_xmat: wp.array2d[wp.mat33],
            actuator_force: wp.array2d[float],
            contacts: wp.array2d[int],
            diverged: wp.array[int],
            overflow: wp.array[int],
        ):
            self._take_starts(rows)
            for name, given in zip(_MOVING, (qpos, qvel, ctrl, qacc_warmstart), strict=True):
                wp.copy(getattr(data, name), given)
            data.overflow.zero_()
            self._step(targets)
            self._read(rows, contacts, diverged)
            after = (qpos_after, qvel_after, ctrl_after, qacc_warmstart_after)
            read = (xpos, xmat, site_xpos, site_xmat, cam_xpos, cam_xmat, actuator_force)
            for name, out in zip((*_MOVING, *_READ), (*after, *read), strict=True):
                wp.copy(out, getattr(data, name))
            wp.copy(overflow, data.overflow)

        n = self._worlds
        dims = {
            **{f"{name}_after": getattr(data, name).shape for name in _MOVING},
            **{name: getattr(data, name).shape for name in _READ},
            "contacts": (n, 3 * self._owned),
            "diverged": n,
            "overflow": n,
        }
        graphs = wp.JaxCallableGraphMode
        return wp.jax_callable(
            control_step,
            num_outputs=len(dims),
            output_dims=dims,
            graph_mode=graphs.WARP_STAGED if self._device.is_cuda else graphs.NONE,
        )

    def _warm_up(self) -> None:
        """Compile every kernel: none can be while a graph is captured."""
        layout, data = self._pool.layout, self._data
        with wp.ScopedDevice(self._device):
            rows = wp.zeros(self._worlds, dtype=int)
            self._take_starts(rows)
            for name in _MOVING:
                first = np.tile(self._fields.states[name][0], (self._worlds, 1))
                getattr(data, name).assign(first.astype(np.float32))
            targets = wp.zeros((self._worlds, layout.substeps, 8), dtype=float)
            self._step(targets)
            contacts = wp.zeros((self._worlds, 3 * self._owned), dtype=int)
            self._read(rows, contacts, wp.zeros(self._worlds, dtype=int))
            wp.synchronize_device()


def dry_engine(pool: StartPool, visual: bool) -> WarpEngine:
    """One world, for `kernels_ahead`: its kernels are those of many."""
    return WarpEngine(pool, 1, Capacity(_DRY_CONTACTS, _DRY_CONSTRAINTS), visual=visual, dry=True)


def _likeness(model: mujoco.MjModel) -> str:
    """The same for models that are expected to launch the same kernels."""
    opt = model.opt
    return str(
        (
            *(model.nq, model.nv, model.nu, model.na, model.nmocap, model.neq, model.ntendon),
            *(opt.cone, opt.solver, opt.integrator, opt.jacobian, opt.noslip_iterations),
            *(opt.enableflags, opt.disableflags),
            sorted(set(zip(model.geom_type.tolist(), model.geom_condim.tolist(), strict=True))),
            sorted(set(model.jnt_type.tolist())),
            (model.body_parentid.tolist(), model.ngeom),
        )
    )


def _size(data: Any) -> int:
    """Bytes of all arrays in a structure of MuJoCo Warp."""
    total = 0
    for field in fields(data):
        value = getattr(data, field.name)
        if isinstance(value, wp.array):
            total += value.size * wp.types.type_size_in_bytes(value.dtype)
        elif is_dataclass(value):
            total += _size(value)
    return total
