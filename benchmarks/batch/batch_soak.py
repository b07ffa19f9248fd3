"""Step batched worlds for minutes with random actions, and print whether speed, memory or numbers change.

python benchmarks/batch/batch_soak.py TASK [--minutes 20] [--worlds 8192] [--engine warp] [--objects NAME ...]

Each minute: environment steps a second, memory of the device and of this process, values that are not finite in worlds that
are not flagged `physics`, worlds flagged so, steps of worlds that are flagged `overflowed` (a flag lasts until its episode
ends), episodes that ended. If there were such steps, a line tells which limits of MuJoCo Warp were met. The last line is a
verdict: the first minute, which may compile, does not count.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Int

from manipose_mj import batch
from manipose_mj.batch.capacity import Capacity
from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.starts import StartPool
from manipose_mj.console.process import compile_at_once_on_gpus
from manipose_mj.evaluation.statistics import machine
from manipose_mj.poses import Array
from manipose_mj.tasks.core.config import EnvConfig

STEPS = 50  # control steps between looks at the clock
HELD = 25  # control steps for which a random action is held
LIMITS = 12  # of MuJoCo Warp that it flags: contacts, rows, iterations and others
SLOWER, GROWTH = 0.05, 64e6  # of the rate, and of memory [bytes], that are no change
COLUMNS = (
    "minute", "environment steps/s", "device [GB]", "process [GB]", "not finite", "physics", "overflowed",
    "episodes",
)  # fmt: skip


class Minute(NamedTuple):
    """Attributes: rate, environment steps a second; device, process, bytes; the others are counts."""

    rate: float
    device: float
    process: float
    broken: int
    physics: int
    overflowed: int
    episodes: int


def main() -> None:
    """Print a row a minute, then the verdict; exit code 1 if something changed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task")
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--worlds", type=int, default=8192)
    parser.add_argument("--engine", default="warp", choices=("warp", "c"))
    parser.add_argument("--objects", nargs="+", help="names of objects, instead of all")
    parser.add_argument("--starts", type=int, default=32, help="drawn before")
    parser.add_argument("--pool", type=Path, help="drawn starts of the task, instead of new ones")
    parser.add_argument("--row", type=float, default=60.0, help="seconds of a row")
    parser.add_argument(
        "--room",
        nargs=2,
        type=float,
        metavar=("CONTACTS", "ROWS"),
        help="of a world, of engine warp",
    )
    arguments = parser.parse_args()
    compile_at_once_on_gpus()
    room = arguments.room
    pool = StartPool.load(arguments.pool) if arguments.pool else _drawn(arguments)
    capacity = None if room is None else Capacity(room[0], int(room[1]))
    worlds = batch.from_pool(pool, arguments.worlds, arguments.engine, capacity=capacity)
    print(f"{machine()}; {jax.devices()[0].device_kind}; MuJoCo {mujoco.__version__}")
    print(f"{pool.layout.task}, engine {arguments.engine}, {arguments.worlds:,} worlds")
    print("| " + " | ".join(COLUMNS) + " |")
    print("|" + " ---: |" * len(COLUMNS), flush=True)
    rows = soak(worlds, 60 * arguments.minutes, arguments.row)
    worlds.close()
    complaints = verdict(rows)
    print("changed: " + "; ".join(complaints) if complaints else "nothing changed")
    raise SystemExit(bool(complaints))


def _drawn(arguments: argparse.Namespace) -> StartPool:
    config = EnvConfig(arguments.task, objects=arguments.objects, reward_mode="dense")
    return draw_pool(config, range(min(arguments.starts, arguments.worlds)))


def soak(worlds: batch.Worlds, seconds: float, row: float) -> list[Minute]:
    """Step and print; `row`: seconds of each row."""
    chunk = jax.jit(lambda state, key: _chunk(worlds, state, key))
    state, key, rows = worlds.reset(jax.random.key(0)), jax.random.key(1), []
    ends, met = time.perf_counter() + seconds, np.zeros(LIMITS, int)
    while time.perf_counter() < ends:
        began, steps, counts = time.perf_counter(), 0, np.zeros(4, int)
        while time.perf_counter() - began < row:
            key, own = jax.random.split(key)
            state, found = chunk(state, own)
            counts += np.asarray(found)
            met = np.maximum(met, limits_met(state))
            steps += STEPS * worlds.count
        rate = steps / (time.perf_counter() - began)
        rows.append(Minute(rate, device_memory(worlds), process_memory(), *counts.tolist()))
        print(_line(len(rows), rows[-1]), flush=True)
    if met.any():
        print(f"limits met, by the most worlds at once: {named_limits(met)}")
    return rows


def verdict(rows: Sequence[Minute]) -> list[str]:
    """What changed from the second minute to the last, or was wrong in any."""
    broken, overflowed = sum(r.broken for r in rows), sum(r.overflowed for r in rows)
    found = [f"{broken} values not finite without a flag"] if broken else []
    found += [f"{overflowed} times a world overflowed"] if overflowed else []
    if len(rows) < 3:
        return [*found, f"{len(rows)} rows are too few to compare"]
    first, last = rows[1], rows[-1]
    if last.rate < (1 - SLOWER) * first.rate:
        found.append(f"slower by {1 - last.rate / first.rate:.0%}")
    for name in ("device", "process"):
        growth = getattr(last, name) - getattr(first, name)
        if growth > GROWTH:
            found.append(f"memory of the {name} grew by {growth / 1e6:.0f} MB")
    return found


def limits_met(state: batch.State) -> Int[np.ndarray, "limits"]:
    """How many worlds have met each limit of the engine `warp` in their episodes, in the order of its bits."""
    if not isinstance(state.simulation, dict):
        return np.zeros(LIMITS, int)
    bits = np.asarray(state.simulation["overflow"])
    return (bits[:, None] >> np.arange(LIMITS) & 1).sum(axis=0)


def named_limits(met: Int[np.ndarray, "limits"]) -> str:
    """As MuJoCo Warp names them, with the counts."""
    from mujoco_warp import OverflowType  # pyright: ignore[reportMissingImports]

    return ", ".join(f"{OverflowType(1 << i).name} {met[i]}" for i in np.flatnonzero(met))


def device_memory(worlds: batch.Worlds) -> float:
    """In use on the GPU by everyone [bytes]; 0 without one."""
    if worlds.engine.name != "warp":
        return 0.0
    import warp as wp  # pyright: ignore[reportMissingImports]

    device = wp.device_from_jax(jax.devices()[0])
    return float(device.total_memory - device.free_memory) if device.is_cuda else 0.0


def process_memory() -> float:
    """Resident in this process [bytes]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


def broken_values(state: batch.State) -> Array:
    """How many numbers are not finite in worlds that are not flagged `physics`; what follows a flag is a new start."""
    flagged = state.terminated
    shown = jax.tree.leaves((state.observation, state.reward, state.measurement))
    kept = jax.tree.leaves(state.final_observation)
    if isinstance(state.simulation, dict):
        shown += [v for v in state.simulation.values() if v.dtype == jnp.float32]

    def count(leaf: Array, which: Array) -> Array:
        bad = ~jnp.isfinite(leaf.reshape(len(leaf), -1)).all(axis=1)
        return (bad & which).sum()

    everywhere = jnp.ones_like(flagged)
    return sum(
        [count(leaf, everywhere) for leaf in shown] + [count(leaf, ~flagged) for leaf in kept],
        jnp.zeros((), int),
    )


def _chunk(worlds: batch.Worlds, state: batch.State, key: Array) -> tuple[batch.State, Array]:
    """Many steps, and counts: not finite, `physics`, overflowed, episodes."""
    lower, upper = jnp.asarray(worlds.lower), jnp.asarray(worlds.upper)

    def hold(state: batch.State, key: Array) -> tuple[batch.State, Array]:
        action = jax.random.uniform(key, (worlds.count, len(lower)), minval=lower, maxval=upper)

        def step(state: batch.State, _: None) -> tuple[batch.State, Array]:
            after = worlds.step(state, action)
            flags = [after.terminated.sum(), after.overflowed.sum(), after.done.sum()]
            return after, jnp.stack([broken_values(after), *flags])

        state, counts = jax.lax.scan(step, state, length=HELD)
        return state, counts.sum(axis=0)

    state, counts = jax.lax.scan(hold, state, jax.random.split(key, STEPS // HELD))
    return state, counts.sum(axis=0)


def _line(number: int, minute: Minute) -> str:
    values = (
        number, f"{minute.rate:,.0f}", f"{minute.device / 1e9:.2f}", f"{minute.process / 1e9:.2f}",
        minute.broken, minute.physics, minute.overflowed, minute.episodes,
    )  # fmt: skip
    return "| " + " | ".join(map(str, values)) + " |"


if __name__ == "__main__":
    main()
