"""The models of a pool's scenes, with the fields that each start has of its own."""

from __future__ import annotations

import mujoco

from manipose_mj.batch.starts import StartPool


class RowModels:
    """A model for each start that is asked for, copied from its scene's at the first time."""

    def __init__(self, pool: StartPool) -> None:
        self._pool = pool
        self._models: dict[int, mujoco.MjModel] = {}

    def at(self, row: int) -> mujoco.MjModel:
        """The model of a start's scene with the start's own fields in it."""
        known = self._models.get(row)
        if known is None:
            start = self._pool.starts[row]
            known = mujoco.MjModel.__copy__(self._pool.scenes[start.scene])
            for name, values in start.model.items():
                getattr(known, name)[:] = values
            self._models[row] = known
        return known


def awake(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy in which nothing sleeps."""
    copied = mujoco.MjModel.__copy__(model)
    copied.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return copied
