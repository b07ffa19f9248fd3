"""Print how fast the constraint solver and the physics step of batched worlds are beside MuJoCo Warp's own.

python benchmarks/batch/step_speed.py TASK [--objects NAME ...] [--worlds 8192 32768] [--pool FILE]

Both begin at the same states, some control steps under random arm targets after the starts. Each is one captured graph,
timed in turns with the other. Differences are of the solvers' accelerations, relative to the largest in a world, and of
what they change a velocity by in a step. "Pairs alike" tells whether as many pairs of shapes are near each other.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import mujoco_warp as mjw
import numpy as np
import warp as wp
from arm_targets import random_targets

from manipose_mj import batch
from manipose_mj.batch.starts import StartPool

TURNS, REPEATS = 5, 20
STEPS = 50


def main() -> None:
    """Print a row for each number of worlds."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task", help="domain/name")
    parser.add_argument("--objects", nargs="+", help="names of objects, instead of all")
    parser.add_argument("--starts", type=int, default=16)
    parser.add_argument("--pool", type=Path, help="drawn starts, instead of drawing")
    parser.add_argument("--worlds", nargs="+", type=int, default=[8192, 32768])
    parser.add_argument("--steps", type=int, default=STEPS, help="control steps before")
    arguments = parser.parse_args()
    print(
        "| worlds | rows a world | iterations | solve, MuJoCo Warp [ms] | here [ms] | step, MuJoCo Warp [ms] "
        "| here [ms] | median difference | 99th percentile | velocity, 99th percentile | limits met | pairs alike |"
    )
    print("|" + " ---: |" * 12, flush=True)
    pool = drawn(arguments)
    for count in arguments.worlds:
        print(row(pool, count, arguments.steps), flush=True)


def drawn(arguments: argparse.Namespace) -> StartPool:
    """The starts that the arguments ask for."""
    if arguments.pool is not None:
        return StartPool.load(arguments.pool)
    from manipose_mj.batch.drawing import draw_pool
    from manipose_mj.tasks.core.config import EnvConfig

    return draw_pool(EnvConfig(arguments.task, objects=arguments.objects), range(arguments.starts))


def row(pool: StartPool, count: int, steps: int) -> str:
    """Of so many worlds."""
    worlds = batch.from_pool(pool, count, "warp")
    state = worlds.reset(jax.random.key(0))
    actions = random_targets(state, steps)
    jax.block_until_ready(jax.jit(lambda s: worlds.rollout(actions, s))(state))
    engine: Any = worlds.engine
    model, data, stepper = engine._model, engine._data, engine._stepper
    if not stepper.fused:
        raise SystemExit("this model is stepped by MuJoCo Warp")
    solver = stepper._solver

    def theirs() -> None:
        mjw.step2(model, data)
        mjw.step1(model, data)

    def ours() -> None:
        stepper.step2()
        stepper.step1()

    with wp.ScopedDevice(engine._device):
        kept = {n: wp.clone(getattr(data, n)) for n in ("qpos", "qvel", "ctrl", "qacc_warmstart")}
        mjw.fwd_actuation(model, data)
        mjw.fwd_acceleration(model, data)
        found = {}
        for name, solve in (("theirs", lambda: mjw.solve(model, data)), ("ours", solver.solve)):
            data.overflow.zero_()
            solve()
            found[name] = data.qacc.numpy().copy(), data.solver_niter.numpy().mean()
        limits = int((data.overflow.numpy() != 0).sum())
        rows = data.nefc.numpy().mean()
        solving = seconds([lambda: mjw.solve(model, data), solver.solve], lambda: None)

        def restore() -> None:
            for name, values in kept.items():
                wp.copy(getattr(data, name), values)
            mjw.step1(model, data)

        restore()
        pairs = data.ncollision.numpy()[0]
        stepper.step1()
        alike = bool(pairs == data.ncollision.numpy()[0])
        stepping = seconds([theirs, ours], restore)
    expected, ours_found = found["theirs"][0], found["ours"][0]
    apart = np.abs(expected - ours_found).max(axis=1)
    relative = apart / np.maximum(np.abs(expected).max(axis=1), 1.0)
    gained = apart * float(pool.scenes[0].opt.timestep)
    worlds.close()
    values = (
        f"{count:,}", f"{rows:.1f}", f"{found['theirs'][1]:.2f}, {found['ours'][1]:.2f}",
        *(f"{1e3 * s:.3f}" for s in (*solving, *stepping)),
        f"{np.median(relative):.1e}", f"{np.quantile(relative, 0.99):.1e}", f"{np.quantile(gained, 0.99):.1e}", limits, alike,
    )  # fmt: skip
    return "| " + " | ".join(map(str, values)) + " |"


def seconds(runs: Sequence[Callable[[], None]], restore: Callable[[], None]) -> list[float]:
    """Of each, in turns; medians."""
    device = wp.get_device()
    graphs = []
    for run in runs:
        restore()
        run()
        if device.is_cuda:
            with wp.ScopedCapture() as capture:
                run()
            graphs.append(capture.graph)
    found: list[list[float]] = [[] for _ in runs]
    for _ in range(TURNS):
        for i, run in enumerate(runs):
            restore()
            wp.synchronize_device(device)
            began = time.perf_counter()
            for _ in range(REPEATS):
                if graphs:
                    wp.capture_launch(graphs[i])
                else:
                    run()
            wp.synchronize_device(device)
            found[i].append((time.perf_counter() - began) / REPEATS)
    return [statistics.median(each) for each in found]


if __name__ == "__main__":
    main()
