"""Print how fast batched worlds step, beside the bare physics of the same model, options and states.

python benchmarks/throughput.py --engine warp|c [--only TASK] [--worlds N ...] [--objects NAME ...]

Both loops run in one process, in turns; medians of the turns. The bare loop of MuJoCo Warp is one captured graph a
control step: `step1`, then `step2` and `step1` for every physics step, with the set-points that our loop sent; that of
engine `c` is one call of `mujoco.rollout` with as many threads as our loop. Figures count only without
overflow and divergence, which are printed.
"""

from __future__ import annotations

import argparse
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from batch.arm_targets import random_targets
from batch.kept_starts import kept_starts
from batch.solver_options import add_set, set_options
from mujoco import rollout

from manipose_mj import batch
from manipose_mj.batch.capacity import Capacity
from manipose_mj.batch.starts import RowModels, StartPool
from manipose_mj.evaluation.statistics import machine
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.simulation_state import unflatten, write_simulation

TURNS = 5
COLUMNS = (
    "task", "worlds", "environment steps/s", "physics steps/s", "bare physics steps/s", "share", "contacts",
    "iterations", "overflowed", "diverged", "memory [GB]", "start [s]", "first step [s]",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Those of this measurement."""
    parser.add_argument("--engine", choices=("c", "warp"), help="of batched worlds")
    parser.add_argument("--worlds", nargs="+", type=int, default=[64])
    parser.add_argument("--objects", nargs="+", help="names of objects, instead of all")
    parser.add_argument("--starts", type=int, default=8, help="drawn before the measurement")
    parser.add_argument("--pool", type=Path, help="drawn starts, read from here or written here")
    parser.add_argument("--steps", type=int, default=50, help="control steps in a turn")
    parser.add_argument("--threads", type=int, default=1, help="of engine c")
    parser.add_argument("--noslip", type=int, help="iterations, instead of the model's own")
    parser.add_argument("--impratio", type=float, help="instead of the model's own")
    add_set(parser, "instead of the model's own")
    parser.add_argument(
        "--room", nargs=2, type=int, metavar=("CONTACTS", "ROWS"), help="of a world, of engine warp"
    )
    parser.add_argument("--resets", type=float, default=0.0, help="share of worlds reset a step")
    parser.add_argument(
        "--alone",
        action="store_true",
        help="also worlds of one object of the pool, in the same slots",
    )


def measure(task: str, arguments: argparse.Namespace) -> None:
    """Print a row for each number of worlds."""
    device = jax.devices()[0].device_kind
    versions = f"MuJoCo {mujoco.__version__}, JAX {jax.__version__}"
    print(f"{machine()}; {device}; Python {platform.python_version()}, {versions}")
    config = EnvConfig(task, objects=arguments.objects, reward_mode="dense")
    pool = kept_starts(arguments.pool, config, range(arguments.starts))
    for model in pool.scenes:
        if arguments.noslip is not None:
            model.opt.noslip_iterations = arguments.noslip
        if arguments.impratio is not None:
            model.opt.impratio = arguments.impratio
        set_options(model, arguments.set)
    options = pool.scenes[0].opt
    print(
        f"{len(pool.starts)} starts of {len(pool.scenes)} scenes; {pool.scenes[0].ngeom} geoms; "
        f"noslip {options.noslip_iterations}, impratio {options.impratio:g}; "
        f"{arguments.steps} control steps a turn, {TURNS} turns"
    )
    print("| " + " | ".join(COLUMNS) + " |")
    print("|" + " --- |" * len(COLUMNS))
    for count in arguments.worlds:
        _row(task, pool, count, arguments)


def _row(task: str, pool: StartPool, count: int, arguments: argparse.Namespace) -> None:
    started = time.perf_counter()
    room = None if arguments.room is None else Capacity(*arguments.room)
    worlds = batch.from_pool(
        pool, count, arguments.engine, threads=arguments.threads, capacity=room
    )
    made = time.perf_counter() - started
    state = worlds.reset(jax.random.key(0))
    actions = random_targets(state, arguments.steps)
    started = time.perf_counter()
    jax.block_until_ready(worlds.step(state, actions[0]))
    first = time.perf_counter() - started
    roll = jax.jit(lambda state, actions: worlds.rollout(actions, state))
    # Half of the episodes begun long ago: arms are where the targets have brought them.
    state, _ = roll(state, actions)
    jax.block_until_ready(roll(state, actions))
    if arguments.resets:
        horizon = worlds.pool.layout.horizon
        spread = jnp.arange(count) % round(1 / arguments.resets)
        state = state._replace(count=horizon - 1 - spread.astype(jnp.int32))
    if arguments.engine == "c":
        bare = _bare_c(worlds, state, actions, arguments.threads)
    else:
        bare = _bare_warp(worlds, state, actions)
    ours, others, ended = [], [], []
    for _ in range(TURNS):
        seconds, (_, seen) = _timed(lambda: roll(state, actions))
        ours.append(seconds)
        ended.append(int(seen.terminated.sum()))
        others.append(_timed(bare)[0])
    substeps = worlds.pool.layout.substeps
    rate = count * arguments.steps / statistics.median(ours)
    bare_rate = count * arguments.steps * substeps / statistics.median(others)
    last = jax.block_until_ready(roll(state, actions)[0])
    contacts, iterations, overflowed, memory = _insight(worlds, last)
    values = (
        task,
        f"{count:,}",
        f"{rate:,.0f}",
        f"{rate * substeps:,.0f}",
        f"{bare_rate:,.0f}",
        f"{rate * substeps / bare_rate:.2f}",
        contacts,
        iterations,
        overflowed,
        max(ended),
        memory,
        f"{made:.1f}",
        f"{first:.1f}",
    )
    print("| " + " | ".join(map(str, values)) + " |", flush=True)
    if arguments.alone:
        _print_alone(worlds, roll, actions)
    worlds.close()


def _print_alone(
    worlds: batch.Worlds, roll: Callable[..., tuple[batch.State, Any]], actions: jax.Array
) -> None:
    """The rate of the mixture over that of each of its objects alone, all in turns."""
    of_object: dict[str, list[int]] = {}
    for start in worlds.pool.starts:
        of_object.setdefault(start.object_name, []).append(start.seed)
    states = {"all": worlds.reset(jax.random.key(0))}
    for name, seeds in sorted(of_object.items()):
        states[name] = worlds.at(np.resize(seeds, worlds.count).tolist())
    states = {name: roll(state, actions)[0] for name, state in states.items()}
    seconds: dict[str, list[float]] = {name: [] for name in states}
    for _ in range(TURNS):
        for name, state in states.items():
            seconds[name].append(_timed(lambda state=state: roll(state, actions))[0])
    medians = {name: statistics.median(each) for name, each in seconds.items()}
    mixed = medians.pop("all")
    for name, alone in medians.items():
        rate = worlds.count * len(actions) / alone
        print(f"{name} alone: {rate:,.0f} environment steps/s; mixed are {alone / mixed:.2f} of it")
    mean = statistics.mean(medians.values())
    print(f"mixed: {mean / mixed:.2f} of as many worlds of each, one object after the other")


def _bare_c(
    worlds: batch.Worlds, state: batch.State, actions: jax.Array, threads: int
) -> Callable[[], object]:
    """`mujoco.rollout` of the same states and set-points."""
    pool, rows = worlds.pool, np.asarray(state.row)
    substeps = pool.layout.substeps
    models, own = {}, RowModels(pool)
    for row in set(rows.tolist()):
        models[row] = mujoco.MjModel.__copy__(own.at(row))
    listed = [models[row] for row in rows]

    def data_of(words: np.ndarray, model: mujoco.MjModel) -> mujoco.MjData:
        data = mujoco.MjData(model)
        write_simulation(model, data, unflatten(model, data, words.view(float)))
        return data

    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    first = np.zeros((len(rows), mujoco.mj_stateSize(listed[0], full)))
    for words, model, out in zip(np.asarray(state.simulation), listed, first, strict=True):
        mujoco.mj_getState(model, data_of(words, model), out, full)
    control = np.zeros((len(rows), len(actions), listed[0].nu))
    for step, action in enumerate(actions):
        state = worlds.step(state, action)
        for i, words in enumerate(np.asarray(state.simulation)):
            control[i, step] = data_of(words, listed[i]).ctrl
    control = np.repeat(control, substeps, axis=1)
    roll = rollout.Rollout(nthread=threads if threads > 1 else 0)
    # Data of one scene do for no other.
    scenes = np.array([pool.starts[row].scene for row in rows])
    groups = [np.flatnonzero(scenes == scene) for scene in np.unique(scenes)]
    datas = [[mujoco.MjData(listed[group[0]]) for _ in range(threads)] for group in groups]

    def run() -> object:
        return [
            roll.rollout([listed[i] for i in group], data, first[group], control[group])[0][:, -1]
            for group, data in zip(groups, datas, strict=True)
        ]

    run()
    return run


def _bare_warp(
    worlds: batch.Worlds, state: batch.State, actions: jax.Array
) -> Callable[[], object]:
    """The captured physics of the same states and set-points."""
    engine = worlds.engine

    def sent(state: batch.State, action: jax.Array) -> tuple[batch.State, jax.Array]:
        state = worlds.step(state, action)
        return state, state.simulation["ctrl"]

    set_points = jax.block_until_ready(jax.jit(lambda s: jax.lax.scan(sent, s, actions)[1])(state))
    import mujoco_warp
    import warp as wp

    model, data = engine._model, engine._data
    given = [wp.from_jax(each) for each in set_points]
    with wp.ScopedCapture(device=engine._device) as capture:
        mujoco_warp.step1(model, data)
        for _ in range(worlds.pool.layout.substeps):
            mujoco_warp.step2(model, data)
            mujoco_warp.step1(model, data)
    start = {n: wp.clone(wp.from_jax(state.simulation[n])) for n in ("qpos", "qvel")}

    def run() -> None:
        for name, values in start.items():
            wp.copy(getattr(data, name), values)
        for ctrl in given:
            wp.copy(data.ctrl, ctrl)
            wp.capture_launch(capture.graph)
        wp.synchronize_device(engine._device)

    run()
    return run


def _insight(worlds: batch.Worlds, state: batch.State) -> tuple[str, str, str, str]:
    """Contacts a world, solver iterations, worlds that overflowed, memory."""
    engine = worlds.engine
    if engine.name == "c":
        return "-", "-", "0", "-"
    import warp as wp

    data = engine._data
    contacts = int(data.nacon.numpy()[0]) / worlds.count
    iterations = float(data.solver_niter.numpy().mean())
    overflowed = int(np.count_nonzero(np.asarray(state.simulation["overflow"])))
    device = engine._device
    used = (device.total_memory - device.free_memory) / 1e9 if device.is_cuda else 0.0
    wp.synchronize_device(device)
    return f"{contacts:.1f}", f"{iterations:.1f}", str(overflowed), f"{used:.1f}"


def _timed(work: Callable[[], object]) -> tuple[float, object]:
    started = time.perf_counter()
    result = jax.block_until_ready(work())
    return time.perf_counter() - started, result
