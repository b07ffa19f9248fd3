"""How long a camera's picture takes: cast anew, and with what was seen before; run it on a quiet machine.

The arm goes to random joint targets with the scene around it. Both ways look at the same moments, in turns, and
their pictures are compared: `equal` counts those that are the same bit for bit.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from manipose_mj import suite
from manipose_mj.mjcf.cameras.ray_camera import RayCamera, RayImage
from manipose_mj.mjcf.cameras.ray_memory import RayMemory

TASKS = ("single_object/target_pose", "clutter/pick", "articulated/store_middle_drawer")
CAMERAS = ("front", "left", "right", "panda/wrist")
_HELD = 25  # control steps for which a target is held


@dataclass
class _Times:
    """Attributes: anew, remembered: seconds of each picture; equal: pictures that are the same both ways."""

    anew: list[float] = field(default_factory=list)
    remembered: list[float] = field(default_factory=list)
    equal: int = 0


def main(
    tasks: tuple[str, ...] = TASKS,
    pictures: int = 40,
    every: int = 5,
    seed: int = 0,
) -> None:
    """Print medians by task and camera.

    Args:
      tasks: Whose scenes.
      pictures: Of each camera.
      every: Control steps between two pictures.
      seed: Of start and actions.
    """
    table = Table(title="one picture of 160 x 120 [ms], medians", title_justify="left")
    for column in ("task", "camera", "cast anew", "with memory", "ratio", "equal"):
        table.add_column(column, justify="left" if column in ("task", "camera") else "right")
    for task in tasks:
        for camera, times in _measured(task, pictures, every, seed).items():
            anew, remembered = (1e3 * float(np.median(t)) for t in (times.anew, times.remembered))
            cells = f"{anew:.1f}", f"{remembered:.1f}", f"{anew / remembered:.1f}"
            table.add_row(task, camera, *cells, f"{times.equal} of {pictures}")
    Console().print(table)


def _measured(task: str, pictures: int, every: int, seed: int) -> dict[str, _Times]:
    environment = suite.load(*task.split("/"), seed=seed)
    environment.reset()
    physics, camera = environment.physics, RayCamera()
    model, data = physics.model.ptr, physics.data.ptr
    spec, rng = environment.action_spec(), np.random.default_rng(seed)
    memories = {name: RayMemory() for name in CAMERAS}
    times = {name: _Times() for name in CAMERAS}
    action = rng.uniform(spec.minimum, spec.maximum)
    for step in range(pictures * every):
        if step % _HELD == 0:
            action = rng.uniform(spec.minimum, spec.maximum)
        environment.step(action)
        if step % every:
            continue
        for name in CAMERAS:
            anew = _timed(times[name].anew, camera, model, data, name, None)
            again = _timed(times[name].remembered, camera, model, data, name, memories[name])
            times[name].equal += _same(anew, again)
    return times


def _timed(
    into: list[float],
    camera: RayCamera,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    name: str,
    memory: RayMemory | None,
) -> RayImage:
    start = time.perf_counter()
    image = camera.render(model, data, name, memory)
    into.append(time.perf_counter() - start)
    return image


def _same(one: RayImage, other: RayImage) -> bool:
    pairs: Sequence[tuple[np.ndarray, np.ndarray]] = (
        (one.depth, other.depth),
        (one.geom_id, other.geom_id),
        (one.normal, other.normal),
    )
    return all(np.array_equal(a, b) for a, b in pairs)


if __name__ == "__main__":
    tyro.cli(main)
