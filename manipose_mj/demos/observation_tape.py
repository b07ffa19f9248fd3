"""Observations of an episode go to its file as they come: pictures of 2,000 steps fit no worker's memory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np

from manipose_mj.demos.layout import COMPRESSION

_ROWS = 16  # steps that are compressed together


class ObservationTape:
    """Writes one row for every observation, `(t, ...)` for each feature that is an array."""

    def __init__(self, group: h5py.Group) -> None:
        """Takes a new group, such as `traj_0/obs`."""
        self._group = group
        self._waiting: dict[str, list[np.ndarray]] = {}

    def append(self, observation: Mapping[str, Any]) -> None:
        """Keep an observation; the instruction, which is no array, is in the description."""
        for name, value in observation.items():
            if not isinstance(value, np.ndarray):
                continue
            rows = self._waiting.setdefault(name, [])
            rows.append(value)
            if len(rows) == _ROWS:
                self._write(name)

    def flush(self) -> None:
        """Write what still waits: at the end."""
        for name in self._waiting:
            self._write(name)

    def _write(self, name: str) -> None:
        rows = self._waiting[name]
        if not rows:
            return
        block = np.stack(rows)
        if name not in self._group:
            shape = block.shape[1:]
            self._group.create_dataset(
                name,
                (0, *shape),
                block.dtype,
                maxshape=(None, *shape),
                chunks=(_ROWS, *shape) if block.size else True,
                **COMPRESSION,
            )
        written: Any = self._group[name]
        written.resize(len(written) + len(block), axis=0)
        written[-len(block) :] = block
        rows.clear()
