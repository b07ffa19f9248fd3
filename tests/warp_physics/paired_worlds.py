"""The same worlds stepped by MuJoCo Warp and with few kernels, on Warp's CPU device."""

from __future__ import annotations

import mujoco_warp as mjw
import numpy as np
import warp as wp

from manipose_mj.warp_physics.stepping import Stepper

WORLDS = 8


class Pair:
    """The same worlds twice: stepped by MuJoCo Warp, and by `Stepper`."""

    def __init__(self, host, worlds=WORLDS, speed=1.0, njmax=300, prepare=None):
        with wp.ScopedDevice("cpu"):
            self.model = mjw.put_model(host)
            self.model.opt.warn_overflow = 0
            if prepare is not None:
                prepare(self.model)
            self.theirs, self.ours = (
                mjw.make_data(host, nworld=worlds, naconmax=80 * worlds, njmax=njmax)
                for _ in range(2)
            )
            rng = np.random.default_rng(0)
            velocities = rng.normal(0.0, speed, (worlds, host.nv)).astype(np.float32)
            for data in (self.theirs, self.ours):
                data.qpos.assign(np.tile(host.qpos0, (worlds, 1)).astype(np.float32))
                data.qvel.assign(velocities)
                data.ctrl.assign(np.full((worlds, host.nu), 0.3, np.float32))
            self.stepper = Stepper(self.model, self.ours)

    def step(self):
        """One step of both from the same states."""
        with wp.ScopedDevice("cpu"):
            for name in ("qpos", "qvel", "qacc_warmstart", "qfrc_applied"):
                wp.copy(getattr(self.ours, name), getattr(self.theirs, name))
            mjw.step(self.model, self.theirs)
            self.stepper.step()

    def apart(self, name):
        """The largest difference, relative to what the largest is in that world."""
        two = self.theirs, self.ours
        expected, found = (getattr(d, name).numpy().reshape(d.nworld, -1) for d in two)
        largest = np.maximum(np.abs(expected).max(axis=1), 1.0)
        return (np.abs(expected - found).max(axis=1) / largest).max()
