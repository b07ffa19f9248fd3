"""The models of a pool's scenes, with the fields that each start has of its own."""

from __future__ import annotations

import mujoco
import numpy as np

from manipose_mj.batch.starts import StartPool


class RowModels:
    """Changes the pool's models in place: one start of a scene at a time."""

    def __init__(self, pool: StartPool) -> None:
        self._pool = pool
        self._present: dict[int, int] = {}
        names: list[set[str]] = [set() for _ in pool.scenes]
        for start in pool.starts:
            names[start.scene] |= set(start.model)
        self._nominal = [
            {name: np.array(getattr(model, name)) for name in sorted(own)}
            for model, own in zip(pool.scenes, names, strict=True)
        ]

    def at(self, row: int) -> mujoco.MjModel:
        """The model of a start's scene with the start's own fields in it."""
        start = self._pool.starts[row]
        model = self._pool.scenes[start.scene]
        if self._present.get(start.scene) != row:
            for name, values in self.fields(row).items():
                getattr(model, name)[:] = values
            self._present[start.scene] = row
        return model

    def fields(self, row: int) -> dict[str, np.ndarray]:
        """The fields in which the starts of its scene differ, as this start has them."""
        start = self._pool.starts[row]
        nominal = self._nominal[start.scene]
        return {name: start.model.get(name, values) for name, values in nominal.items()}
