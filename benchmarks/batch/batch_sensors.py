"""Print how fast batched worlds see, and how long the way from images to joint angles takes.

python benchmarks/batch/batch_sensors.py [single_object/target_pose] --objects mug_000 --worlds 1024 [--engine warp|c]

Three cameras. "look": depth and segmentation. "with noise and clouds": a Kinect's noise, and a cloud of the object
with normals. "whole loop": look, noise, cloud, pose estimate, grasp choice, inverse kinematics. Medians of the turns.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from kept_starts import kept_starts

from manipose_mj import batch
from manipose_mj.assets import catalogue
from manipose_mj.batch.perception.cameras import Cameras
from manipose_mj.batch.perception.clouds import noisy_images, object_clouds
from manipose_mj.batch.perception.reaching import estimate_and_choose, grasp_table
from manipose_mj.batch.starts import StartPool
from manipose_mj.console.process import compile_at_once_on_gpus
from manipose_mj.errors import InputError
from manipose_mj.evaluation.statistics import machine
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.tasks.core.config import EnvConfig

TURNS = 5


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", nargs="?", default="single_object/target_pose")
    parser.add_argument("--objects", nargs="+", default=["mug_000"])
    parser.add_argument("--estimator", help="category or type; by default the first object's")
    parser.add_argument("--worlds", type=int, default=1024)
    parser.add_argument("--engine", choices=("auto", "c", "warp"), default="auto")
    parser.add_argument("--starts", type=int, default=16)
    parser.add_argument("--size", nargs=2, type=int, default=(120, 160), help="height and width")
    parser.add_argument("--points", type=int, default=512, help="of a cloud")
    parser.add_argument("--pool", type=Path, help="drawn starts, read from here or written here")
    parser.add_argument("--rgb", action="store_true", help="colours too")
    parser.add_argument("--blind", action="store_true", help="no estimates: look and clouds alone")
    arguments = parser.parse_args()
    compile_at_once_on_gpus()
    print(f"{machine()}; {jax.devices()[0].device_kind}, JAX {jax.__version__}")
    config = EnvConfig(arguments.task, objects=arguments.objects, obs_mode="state+pose")
    pool = kept_starts(arguments.pool, config, range(arguments.starts))
    worlds = batch.from_pool(pool, arguments.worlds, arguments.engine, visual=True)
    started = time.perf_counter()
    height, width = arguments.size
    cameras = Cameras(worlds, height=height, width=width, rgb=arguments.rgb)
    state = worlds.reset(jax.random.key(0))
    key = jax.random.key(1)
    numbers = cameras.numbers(state)[:, 0] if pool.layout.objects else jnp.ones(worlds.count, int)

    def clouds(state: Any) -> Any:
        images = noisy_images(cameras.look(state), key)
        return images, object_clouds(images, 0, numbers, arguments.points, key)

    ways: dict[str, Callable[[Any], Any]] = {"look": cameras.look, "with noise and clouds": clouds}
    if not arguments.blind:
        ways["whole loop"] = _whole(pool, state, clouds, arguments.estimator)
    print("| what | first [s] | seconds | worlds/s |")
    print("| --- | --- | --- | --- |")
    for name, way in ways.items():
        compiled = jax.jit(way)
        jax.block_until_ready(compiled(state))
        first, taken = time.perf_counter() - started, []
        for _ in range(TURNS):
            started = time.perf_counter()
            found = jax.block_until_ready(compiled(state))
            taken.append(time.perf_counter() - started)
        seconds = statistics.median(taken)
        print(f"| {name} | {first:.1f} | {seconds:.4f} | {worlds.count / seconds:,.0f} |")
        if name == "whole loop":
            labels, choice = found
            print(f"grasps in reach: {float(choice.found.mean()):.0%}")
        started = time.perf_counter()
    worlds.close()


def _whole(
    pool: StartPool, state: Any, clouds: Callable[[Any], Any], estimator: str | None
) -> Callable[[Any], Any]:
    """From images to joint angles."""
    names = sorted({start.object_name for start in pool.starts})
    assets = [catalogue.load_by_name(name) for name in names]
    if not assets:
        raise InputError("the task has no objects: add --blind")
    model = PoseEstimator.load(estimator or assets[0].category).trained.model
    table = grasp_table(assets)
    row_of = np.array([names.index(start.object_name) for start in pool.starts])
    rows = jnp.asarray(row_of)[state.row]

    def whole(state: Any) -> Any:
        images, seen = clouds(state)
        return estimate_and_choose(
            model, *seen, images.poses[:, 0], rows, table, key=jax.random.key(2)
        )

    return whole


if __name__ == "__main__":
    main()
