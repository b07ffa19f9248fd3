"""Sleeping things: MuJoCo skips what rests, and what can never move."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
from dm_control import mjcf

_SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)


@contextmanager
def sleep_disabled(physics: mjcf.Physics) -> Iterator[None]:
    """Let `physics.forward()` follow what is written to the model: where furniture, markers, cameras are.

    While sleep is on, MuJoCo (3.17) places bodies without joints once, when its data are reset, and
    never looks at `body_pos`, `cam_pos` and so on again.
    """
    options = physics.model.opt
    flags = int(options.enableflags)
    options.enableflags = flags & ~_SLEEP
    try:
        yield
    finally:
        options.enableflags = flags
