"""What was computed from one state of a simulation, kept until the state is another."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from dm_control import mjcf

Value = TypeVar("Value")


class StepCache:
    """Values by name, all of the same step.

    A step is a time and a configuration. What is changed in the model between two reads at one
    step (another episode's start, a restored state) has to be told by `forget`.
    """

    def __init__(self) -> None:
        self._step: tuple[float, bytes] | None = None
        self._values: dict[str, object] = {}

    def get(self, physics: mjcf.Physics, name: str, make: Callable[[], Value]) -> Value:
        """The value of this name, made if it is not of now."""
        step = (float(physics.data.time), physics.data.qpos.tobytes())
        if step != self._step:
            self._values.clear()
            self._step = step
        if name not in self._values:
            self._values[name] = make()
        return self._values[name]  # pyright: ignore[reportReturnType]

    def forget(self) -> None:
        """Drop everything."""
        self._step = None
        self._values.clear()


def step_number(physics: mjcf.Physics) -> int:
    """How many physics steps the episode is old."""
    return round(float(physics.data.time) / float(physics.model.opt.timestep))
