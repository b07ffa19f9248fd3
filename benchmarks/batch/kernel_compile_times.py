"""Print how long each kernel of a scene takes to compile for a GPU that need not be there.

python benchmarks/batch/kernel_compile_times.py TASK [--objects NAME ...] [--arch 90] [--optimization 0-3] [--ptx]
    [--only TEXT]

CPU seconds of one process, one module after the other, into an empty folder; the slowest first, then the sum.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import warp as wp  # pyright: ignore[reportMissingImports]

from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.engine_warp import dry_engine
from manipose_mj.batch.kernels.kernels_ahead import Launch, launches
from manipose_mj.batch.starts import StartPool
from manipose_mj.evaluation.statistics import machine
from manipose_mj.tasks.core.config import EnvConfig

SHOWN = 12


def main() -> None:
    """Compile and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task")
    parser.add_argument("--objects", nargs="+", help="names of objects, instead of all")
    parser.add_argument("--starts", type=int, default=4)
    parser.add_argument("--pool", type=Path, help="drawn starts, read instead")
    parser.add_argument("--arch", type=int, default=90, help="of the GPU")
    parser.add_argument("--optimization", type=int, help="level; Warp's own without it")
    parser.add_argument("--ptx", action="store_true", help="instead of machine code")
    parser.add_argument("--only", default="", help="kernels with this in their name")
    arguments = parser.parse_args()
    if arguments.pool is None:
        config = EnvConfig(arguments.task, objects=arguments.objects)
        pool = draw_pool(config, range(arguments.starts))
    else:
        pool = StartPool.load(arguments.pool)
    found = [o for o in launches(dry_engine, (pool, False)) if arguments.only in o.name]
    print(f"{machine()}; Warp {wp.__version__}; {len(found)} modules for sm_{arguments.arch}")
    taken = {one.name: seconds(one, arguments) for one in found}
    print("| module | CPU seconds |")
    print("| --- | ---: |")
    for name, own in sorted(taken.items(), key=lambda item: -item[1])[:SHOWN]:
        print(f"| {name} | {own:.1f} |")
    print(f"| all {len(taken)} | {sum(taken.values()):.1f} |")


def seconds(launch: Launch, arguments: argparse.Namespace) -> float:
    """Of one module."""
    launch.module.options["block_dim"] = launch.block_dim
    if arguments.optimization is not None:
        launch.module.options["optimization_level"] = arguments.optimization
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        wp.compile_aot_module(
            launch.module, arch=arguments.arch, module_dir=folder, use_ptx=arguments.ptx
        )
        return time.process_time() - began


if __name__ == "__main__":
    main()
