"""Print how long the first step of batched worlds takes from nothing, and from a warm kernel cache, by stage.

python benchmarks/batch/first_start.py TASK [--objects NAME ...] [--worlds 8192] [--pool FILE] [--engine warp]

Each start is a process of its own. The first has an empty cache of kernels, unless CUDA's own (`~/.nv`) knows some; the second
has the first one's. `WARP_CACHE_PATH` is set for both.
"""

from __future__ import annotations

import argparse
import logging
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

BEGAN = time.perf_counter()
STAGES = ("imports", "starts", "make", "reset", "first step", "second step", "all")
_KERNELS = re.compile(r"kernels compiled in ([0-9.]+) s by (\d+) processes")


def main() -> None:
    """Print a row for each start."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task")
    parser.add_argument("--objects", nargs="+", help="names of objects, instead of all")
    parser.add_argument("--worlds", type=int, default=8192)
    parser.add_argument("--starts", type=int, default=16)
    parser.add_argument("--pool", type=Path, help="drawn starts, read from here or written here")
    parser.add_argument("--engine", default="warp", choices=("warp", "c"))
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        start(arguments)
        return
    print("| kernel cache | " + " [s] | ".join(STAGES) + " [s] | of it kernels |")
    print("|" + " --- |" * (len(STAGES) + 2), flush=True)
    with tempfile.TemporaryDirectory() as cache:
        for name in ("empty", "warm"):
            print(row(name, cache, [*sys.argv[1:], "--one"]), flush=True)


def row(name: str, cache: str, arguments: Sequence[str]) -> str:
    """Of one start in a process of its own.

    Args:
      name: Of the row.
      cache: The folder of the kernel cache.
      arguments: For the process.
    """
    done = subprocess.run(
        [sys.executable, __file__, *arguments],
        env=os.environ | {"WARP_CACHE_PATH": cache},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        return f"| {name} | failed: {done.stderr.strip().splitlines()[-1:]} |"
    seconds = done.stdout.strip().splitlines()[-1].split()
    found = _KERNELS.search(done.stderr)
    kernels = f"{found[1]} s in {found[2]} processes" if found else "-"
    return f"| {name} | " + " | ".join([*seconds, kernels]) + " |"


def start(arguments: argparse.Namespace) -> None:
    """Make worlds and step; print the seconds of each stage in one line."""
    logging.basicConfig(level=logging.INFO)
    import jax
    import jax.numpy as jnp

    from manipose_mj import batch
    from manipose_mj.batch.drawing import draw_pool
    from manipose_mj.tasks.core.config import EnvConfig

    jax.devices()
    marks = [BEGAN, time.perf_counter()]
    if arguments.pool is not None and arguments.pool.exists():
        pool = batch.StartPool.load(arguments.pool)
    else:
        config = EnvConfig(arguments.task, objects=arguments.objects, reward_mode="dense")
        pool = draw_pool(config, range(arguments.starts))
        if arguments.pool is not None:
            pool.save(arguments.pool)
    marks.append(time.perf_counter())
    worlds = batch.from_pool(pool, arguments.worlds, arguments.engine)
    marks.append(time.perf_counter())
    state = jax.block_until_ready(worlds.reset(jax.random.key(0)))
    marks.append(time.perf_counter())
    joints = state.measurement.joints
    action = jnp.concatenate([joints, jnp.full((len(joints), 1), 0.04)], axis=1)
    for _ in range(2):
        state = jax.block_until_ready(worlds.step(state, action))
        marks.append(time.perf_counter())
    taken = [b - a for a, b in zip(marks[:-1], marks[1:], strict=True)]
    print(*(f"{seconds:.1f}" for seconds in (*taken, marks[-1] - BEGAN)))


if __name__ == "__main__":
    main()
