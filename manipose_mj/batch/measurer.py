"""Measures many simulations at once: their arrays side by side, and one gather from all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.batch.measurement import FlatMeasurement, flat_values, gathered, touching
from manipose_mj.batch.starts import StartPool
from manipose_mj.tasks.scene.indices import NOBODY


class _Arrays(NamedTuple):
    """Of MuJoCo's data, those that measurements are made of."""

    qpos: np.ndarray
    qvel: np.ndarray
    actuator_force: np.ndarray
    site_xpos: np.ndarray
    site_xmat: np.ndarray
    xpos: np.ndarray
    xmat: np.ndarray
    cam_xpos: np.ndarray
    cam_xmat: np.ndarray


def read_views(data: mujoco.MjData) -> list[Float[np.ndarray, " _"]]:
    """The arrays that measurements are made of, flat, which follow the data."""
    return [getattr(data, name).reshape(-1) for name in _Arrays._fields]


class Measurer:
    """Knows for every start of a pool where its measurement is."""

    def __init__(self, pool: StartPool) -> None:
        starts = pool.starts
        numbers = [_numbers(model) for model in pool.scenes]
        self._contacts = starts[0].measurement.contacts.shape
        none = np.zeros(self._contacts, bool)
        self._places = np.stack(
            [flat_values(gathered(numbers[s.scene], s.addresses, none)) for s in starts]
        )
        owners = [start.addresses.owners for start in starts]
        self._owners = np.full((len(owners), max(map(len, owners))), NOBODY)
        for row, own in zip(self._owners, owners, strict=True):
            row[: len(own)] = own
        sizes = [sum(array.size for array in own) for own in numbers]
        self._sizes, self._longest = [sizes[start.scene] for start in starts], max(sizes)

    def measure(
        self,
        datas: Sequence[mujoco.MjData],
        views: Sequence[Sequence[Float[np.ndarray, " _"]]],
        rows: Int[np.ndarray, " worlds"],
    ) -> FlatMeasurement:
        """What `measure` gives, of all worlds.

        Args:
          datas: Of the worlds.
          views: `read_views` of each.
          rows: Their starts.
        """
        raw = np.empty((len(datas), self._longest))
        for own, arrays, row in zip(raw, views, rows.tolist(), strict=True):
            np.concatenate(arrays, out=own[: self._sizes[row]])
        values = np.take_along_axis(raw, self._places[rows], axis=1)
        return FlatMeasurement(values, self._contacts_of(datas, rows))

    def _contacts_of(
        self, datas: Sequence[mujoco.MjData], rows: Int[np.ndarray, " worlds"]
    ) -> Bool[np.ndarray, "worlds 3 owned"]:
        found = np.zeros((len(datas), *self._contacts), bool)
        counts = [data.ncon for data in datas]
        if any(counts):
            geoms = np.concatenate(
                [data.contact.geom for data, n in zip(datas, counts, strict=True) if n]
            )
            worlds = np.repeat(np.arange(len(datas)), counts)
            kinds, owned, which = touching(self._owners[rows[worlds][:, None], geoms])
            found[worlds[which], kinds, owned] = True
        return found


def _numbers(model: mujoco.MjModel) -> _Arrays:
    """In place of each value the number that it has when all arrays follow one another."""
    shapes = (
        (model.nq,), (model.nv,), (model.nu,), (model.nsite, 3), (model.nsite, 9), (model.nbody, 3),
        (model.nbody, 9), (model.ncam, 3), (model.ncam, 9),
    )  # fmt: skip
    sizes = [int(np.prod(shape)) for shape in shapes]
    ends = np.cumsum(sizes)
    return _Arrays(
        *(
            np.arange(end - size, end).reshape(shape)
            for end, size, shape in zip(ends, sizes, shapes, strict=True)
        )
    )
