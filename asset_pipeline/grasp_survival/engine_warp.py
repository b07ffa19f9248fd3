"""Grasp trials on an NVIDIA GPU: worlds of MuJoCo Warp that try one after another, one captured graph a step."""

import importlib.util
from dataclasses import dataclass
from math import cos
from typing import Any

import numpy as np
from jaxtyping import Bool

from asset_pipeline.grasp_survival.grid import TrialGrid
from asset_pipeline.grasp_survival.trial_model import GridTrial, motion
from manipose_mj.assets.physics import GRAVITY
from manipose_mj.errors import how_to_install

WORLDS = 16384  # at the same time
_PART = 1 << 18  # trials that lie on the device at once
# The hand lifts before its time where nothing was faster than this for so many steps [m/s, rad/s].
_CALM_SPEED, _CALM_TURNING, _CALM_STEPS = 0.005, 0.1, 5
# Solver iterations of a step, at most: all worlds wait for the one that takes most. With 6, verdicts on bottles differ.
_ITERATIONS = 8
_CHUNK = 16  # steps between two looks at whether all trials have ended


@dataclass(frozen=True)
class Room:
    """What a world has room for. Attributes: contacts: on average over all; rows: of constraints, each."""

    contacts: int
    rows: int


# Held objects have 4 to 8 contacts, at most some 20. What more room costs is time, whether it is used or not.
USUAL_ROOM, MOST_ROOM = Room(24, 160), Room(64, 480)
_MOST_WORLDS = 2048  # with most room


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

    A world whose trial is decided begins the next one at once: an object that was dropped, or that the open hand
    touches, takes no further steps, and a hand that holds still does not wait for the end of its time to close.

    Attributes: worlds: how many.
    """

    def __init__(self, trial: GridTrial, worlds: int, room: Room = USUAL_ROOM) -> None:
        """Copies the model to the device; the first trials compile."""
        import mujoco_warp  # pyright: ignore[reportMissingImports]
        import warp as wp  # pyright: ignore[reportMissingImports]

        from asset_pipeline.grasp_survival import warp_kernels
        from manipose_mj.warp_physics.stepping import Stepper

        self._mjw, self._wp, self._kernels = mujoco_warp, wp, warp_kernels
        self._trial, self.worlds, self._room = trial, worlds, room
        host = trial.model
        self._model = mujoco_warp.put_model(host)
        self._model.opt.warn_overflow = 0  # it is reported, not printed
        self._model.opt.iterations = _ITERATIONS
        self._data = mujoco_warp.make_data(
            host, nworld=worlds, naconmax=room.contacts * worlds, njmax=room.rows
        )
        self._stepper = Stepper(self._model, self._data)
        self._model.opt.gravity = wp.zeros(worlds, dtype=wp.vec3)
        friction = np.repeat(host.geom_friction[None].astype(np.float32), worlds, axis=0)
        self._model.geom_friction = wp.array(friction, dtype=wp.vec3)
        self._course_of_all = self._course()
        self._states = warp_kernels.Worlds()
        for name in ("trial", "step", "calm", "touching"):
            setattr(self._states, name, wp.zeros(worlds, dtype=int))
        self._states.closed = wp.zeros((worlds, host.nq), dtype=float)
        self._trials = warp_kernels.Trials()
        for name in ("count", "begun", "ended"):
            setattr(self._trials, name, wp.zeros(1, dtype=int))
        for name, kind in (("friction", float), ("held", int), ("counts", int), ("up", wp.vec3)):
            setattr(self._trials, name, wp.zeros(_PART, dtype=kind))
        self._trials.start = wp.zeros((_PART, host.nq), dtype=float)
        self._graph: Any = None
        self._roomier: Batch | None = None

    def held(self, grid: TrialGrid) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
        """Whether the object is still where it was in the hand, and whether that counts, as `held_warp` says.

        What there was no room for is tried again with more of it.
        """
        parts = [grid.part(slice(i, i + _PART)) for i in range(0, len(grid), _PART)]
        found = [self._run(part) for part in parts]
        held, counts = (np.concatenate(column) for column in zip(*found, strict=True))
        if not counts.all() and self._room != MOST_ROOM:
            if self._roomier is None:
                self._roomier = Batch(self._trial, min(self.worlds, _MOST_WORLDS), MOST_ROOM)
            again = ~counts
            held[again], counts[again] = self._roomier.held(grid.part(again))
        return held, counts

    def _course(self) -> Any:
        """`warp_kernels.Course`."""
        wp, config, course = self._wp, self._trial.config, self._kernels.Course()
        # The hand stays where it is while it closes.
        waiting = round(config.close_time / config.timestep)
        up, aside = motion(config)
        course.waiting = waiting
        course.calm_speed, course.calm_turning = _CALM_SPEED, _CALM_TURNING
        course.calm_steps = _CALM_STEPS
        course.ignored = int(self._mjw.OverflowType.ITERATIONS)
        course.up = wp.array(np.concatenate([np.zeros(waiting), up]), dtype=float)
        course.aside = wp.array(np.concatenate([np.zeros((waiting, 3)), aside]), dtype=wp.vec3)
        course.gravity, course.slip, course.alike = GRAVITY, config.slip, cos(config.turn / 2)
        course.hand_geoms = wp.array(self._trial.hand_geoms, dtype=int)
        return course

    def _run(self, grid: TrialGrid) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
        trials, states, count = self._trials, self._states, len(grid)
        trials.start[:count].assign(self._trial.first_positions(grid).astype(np.float32))
        trials.up[:count].assign(grid.ups.astype(np.float32))
        trials.friction[:count].assign(grid.frictions.astype(np.float32))
        trials.count.fill_(count)
        trials.begun.zero_()
        trials.ended.zero_()
        self._mjw.reset_data(self._model, self._data)
        states.trial.fill_(-1)
        self._go_on()
        while trials.ended.numpy()[0] < count:
            self._advance(_CHUNK)
        held, counts = (array.numpy()[:count] == 1 for array in (trials.held, trials.counts))
        return held, counts

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
        self._stepper.step()
        found = [data.nacon, data.contact.worldid, data.contact.dist, self._states]
        wp.launch(kernels.find_touching, data.naconmax, inputs=found)
        self._go_on()

    def _go_on(self) -> None:
        model, data = self._model, self._data
        ours = [self._trials, self._course_of_all, self._states]
        theirs = [data.qpos, data.qvel, data.qacc_warmstart, data.ctrl]
        theirs += [model.opt.gravity, model.geom_friction, data.overflow]
        self._wp.launch(self._kernels.go_on, self.worlds, inputs=ours + theirs)
