"""Print how fast the tasks reset, step and see on one core of this machine.

python benchmarks/throughput.py
"""

from __future__ import annotations

import functools
import platform
import statistics
import time

import mujoco
import numpy as np

from manipose_mj import suite
from manipose_mj.evaluation.statistics import machine
from manipose_mj.mjcf.ray_camera import RayCamera

RESETS = 30
STEPS = 500
IMAGES = 50


def main() -> None:
    """Print one row per task."""
    print(f"{machine()}; Python {platform.python_version()}, MuJoCo {mujoco.__version__}")
    print(
        "| task | reset [ms] | physics steps/s, environment | physics steps/s, bare | depth 160x120 [ms] |"
    )
    print("| --- | --- | --- | --- | --- |")
    for domain, task in suite.ALL_TASKS:
        environment = suite.load(domain, task, seed=0)
        resets = [_milliseconds(environment.reset) for _ in range(RESETS)]
        action = _hold(environment)
        substeps = environment.task.physics_steps_per_control_step

        started = time.perf_counter()
        for _ in range(STEPS):
            environment.step(action)
        stepped = STEPS * substeps / (time.perf_counter() - started)

        model, data = environment.physics.model.ptr, environment.physics.data.ptr
        started = time.perf_counter()
        mujoco.mj_step(model, data, STEPS * substeps)
        bare = STEPS * substeps / (time.perf_counter() - started)

        camera = RayCamera(120, 160)
        camera.render(model, data, "front")
        draw = functools.partial(camera.render, model, data, "front")
        images = [_milliseconds(draw) for _ in range(IMAGES)]
        print(
            f"| `{domain}/{task}` | {statistics.median(resets):.1f} | {stepped:,.0f} | {bare:,.0f} "
            f"| {statistics.median(images):.1f} |"
        )


def _hold(environment) -> np.ndarray:
    joints, opening = environment.task.robot.configuration(environment.physics)
    return np.append(joints, opening)


def _milliseconds(call) -> float:
    started = time.perf_counter()
    call()
    return 1e3 * (time.perf_counter() - started)


if __name__ == "__main__":
    main()
