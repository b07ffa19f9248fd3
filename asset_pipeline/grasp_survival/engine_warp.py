"""Grasp trials on an NVIDIA GPU: a world each in MuJoCo Warp, one captured graph a step."""

import importlib.util
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from asset_pipeline.grasp_survival.grid import TrialGrid
from asset_pipeline.grasp_survival.trial_model import BODY, GridTrial, motion
from manipose_mj.assets.physics import GRAVITY
from manipose_mj.errors import how_to_install
from manipose_mj.poses import quaternion_to_rotation, rotation_angle

WORLDS = 16384  # at the same time
# Room for contacts of a world on average, and for rows of constraints of each world.
_CONTACTS, _ROWS = 48, 320


def missing_for_warp() -> str:
    """What this machine lacks, and how to get it, in one line; empty if nothing."""
    absent = [n for n in ("warp", "mujoco_warp") if importlib.util.find_spec(n) is None]
    if absent:
        return f"no module {' and '.join(absent)}; {how_to_install('gpu')}"
    import warp as wp  # pyright: ignore[reportMissingImports]

    if not wp.get_cuda_device_count():
        return "there is no NVIDIA GPU; take engine c"
    return ""


def held_warp(
    trial: GridTrial, grid: TrialGrid, worlds: int = WORLDS
) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Whether the object is still where it was in the hand, and whether that counts, by trial.

    Args:
      trial: The object and the hand.
      grid: The trials.
      worlds: At the same time.

    Returns:
      Whether it was held, and whether there was room for all of the trial's contacts.
    """
    if not len(grid):
        return np.zeros(0, bool), np.zeros(0, bool)
    return Batch(trial, min(worlds, len(grid))).held(grid)


class Batch:
    """So many worlds of one object, on the default device of Warp.

    Attributes: worlds: how many.
    """

    def __init__(self, trial: GridTrial, worlds: int) -> None:
        """Copies the model to the device; the first trials compile."""
        import mujoco_warp  # pyright: ignore[reportMissingImports]
        import warp as wp  # pyright: ignore[reportMissingImports]

        from asset_pipeline.grasp_survival import warp_kernels

        self._mjw, self._wp, self._kernels = mujoco_warp, wp, warp_kernels
        self._trial, self.worlds = trial, worlds
        host = trial.model
        self._model = mujoco_warp.put_model(host)
        self._model.opt.warn_overflow = 0  # it is reported, not printed
        self._data = mujoco_warp.make_data(
            host, nworld=worlds, naconmax=_CONTACTS * worlds, njmax=_ROWS
        )
        self._model.opt.gravity = wp.zeros(worlds, dtype=wp.vec3)
        self._friction = np.repeat(host.geom_friction[None].astype(np.float32), worlds, axis=0)
        self._model.geom_friction = wp.array(self._friction, dtype=wp.vec3)
        # The hand stays where it is while it closes.
        waiting = round(trial.config.close_time / trial.config.timestep)
        up, aside = motion(trial.config)
        self._waiting, self._moving = waiting, len(up)
        still = np.zeros(waiting)
        self._up = wp.array(np.concatenate([still, up]), dtype=float)
        self._aside = wp.array(np.concatenate([np.zeros((waiting, 3)), aside]), dtype=wp.vec3)
        self._ups = wp.zeros(worlds, dtype=wp.vec3)
        self._step = wp.zeros(1, dtype=int)
        self._touching = wp.zeros(worlds, dtype=int)
        self._furthest = wp.zeros(worlds, dtype=float)
        self._closed = wp.zeros((worlds, host.nq), dtype=float)
        self._graph: Any = None

    def held(self, grid: TrialGrid) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
        """Whether the object is still where it was in the hand, and whether that counts, as `held_warp` says."""
        # The last part is filled with the last trial.
        rows = [
            np.minimum(np.arange(first, first + self.worlds), len(grid) - 1)
            for first in range(0, len(grid), self.worlds)
        ]
        found = [self._run(grid.part(part)) for part in rows]
        held, counts = (np.concatenate(column)[: len(grid)] for column in zip(*found, strict=True))
        return held, counts

    def _run(self, grid: TrialGrid) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
        wp, data, config = self._wp, self._data, self._trial.config
        friction = self._friction
        friction[:, self._trial.hand_geoms, 0] = grid.frictions[:, None]
        self._model.geom_friction.assign(friction)
        self._model.opt.gravity.zero_()
        self._ups.assign(grid.ups.astype(np.float32))
        self._mjw.reset_data(self._model, data)
        data.qpos.assign(self._trial.first_positions(grid).astype(np.float32))
        data.overflow.zero_()
        self._touching.zero_()
        self._step.zero_()
        self._mjw.fwd_position(self._model, data)
        wp.launch(
            self._kernels.find_touching,
            data.naconmax,
            inputs=[data.nacon, data.contact.worldid, data.contact.dist],
            outputs=[self._touching],
        )
        self._advance(self._waiting)
        closed = data.qpos.numpy().copy()  # on the CPU it is the array itself
        self._closed.assign(closed)
        self._furthest.zero_()
        self._model.opt.gravity.assign((-GRAVITY * grid.ups).astype(np.float32))
        self._advance(self._moving)
        held = _kept(closed, data.qpos.numpy(), config.slip, config.turn)
        held &= self._furthest.numpy() <= 2 * config.slip
        held &= self._touching.numpy() == 0
        return held, data.overflow.numpy() == 0

    def _advance(self, steps: int) -> None:
        """So many steps; the first of all compiles, the second is captured, where there is a GPU."""
        wp = self._wp
        if not wp.get_device().is_cuda:
            for _ in range(steps):
                self._once()
            return
        if self._graph is None:
            self._once()
            steps -= 1
            with wp.ScopedCapture() as capture:
                self._once()
            self._graph = capture.graph
        for _ in range(steps):
            wp.capture_launch(self._graph)

    def _once(self) -> None:
        wp, data, kernels = self._wp, self._data, self._kernels
        targets = [self._step, self._up, self._aside, self._ups]
        wp.launch(kernels.move_hand, self.worlds, inputs=targets, outputs=[data.ctrl])
        self._mjw.step(self._model, data)
        moved = [data.qpos, self._closed]
        wp.launch(kernels.follow, self.worlds, inputs=moved, outputs=[self._furthest])
        wp.launch(kernels.next_step, 1, outputs=[self._step])


def _kept(
    closed: Float[np.ndarray, "n nq"], end: Float[np.ndarray, "n nq"], slip: float, turn: float
) -> Bool[np.ndarray, " n"]:
    """Whether the object slipped and turned by less than this since the hand had closed."""
    moved = end[:, :3] - end[:, 7:10] - closed[:, :3]
    finite = np.isfinite(np.concatenate([end, closed], axis=1))
    valid = np.asarray(finite.all(axis=1, keepdims=True))
    whole = np.array([1.0, 0.0, 0.0, 0.0])
    first, last = (np.where(valid, q[:, BODY][:, 3:], whole) for q in (closed, end))
    turned = rotation_angle(quaternion_to_rotation(last), quaternion_to_rotation(first))
    return valid[:, 0] & (np.linalg.norm(moved, axis=1) < slip) & (turned < turn)
