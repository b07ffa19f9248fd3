"""How fast the pose estimator is: one object, batches of 1,024, and time against the number of pairs.

    python benchmarks/pose_speed.py [--category cup] [--weights FILE] [--parts one batch pairs]
        [--at-once 128] [--json FILE]

One object: clouds of 1,024 bare points, one after another, normals included, after compilation; in the same
run CPPF as published and OpenCV's matcher on the same clouds, taking turns so that a busy machine slows all
alike. CPU time is of all threads of this process. Batches: points with normals, as many at once as the
model says, or `--at-once`. All of it on the device that JAX runs on; on a GPU only the last two parts by
default. Weights do not matter to the time of CPPF: they are random. Under three minutes on two idle cores, and under
one on a GPU.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from pose_matchers import available, template
from pose_tables.options import check_categories, check_files, write_rows
from scipy.spatial.transform import Rotation

from manipose_mj.console.process import compile_at_once_on_gpus
from manipose_mj.errors import InputError
from manipose_mj.evaluation.statistics import machine
from manipose_mj.ppf_jax.cppf.model import CppfModel
from manipose_mj.ppf_jax.cppf.voting import CppfConfig
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.points.cloud_normals import cloud_normals
from manipose_mj.ppf_jax.points.clouds import MAX_POINTS
from manipose_mj.ppf_jax.rigid.model import PoseModel, estimate_batch
from manipose_mj.ppf_jax.weight_files import TrainedModel

BATCH = 1024
OBJECTS, SLOW_OBJECTS = 100, 4  # timed one by one: ours; of methods that take seconds
PAIRS = (2048, 4096, 8192, 16384)
NORMALS = "normals alone"
MATCHER = "OpenCV ppf_match_3d + ICP"
PARTS = ("one", "batch", "pairs")
Row = dict[str, Any]


@dataclass(frozen=True)
class Spent:
    """Attributes: wall, seconds; cpu, seconds of all threads."""

    wall: float
    cpu: float


def timed(work: Callable[[], object]) -> Spent:
    """What one call takes."""
    cpu, wall = time.process_time(), time.perf_counter()
    jax.block_until_ready(work())
    return Spent(time.perf_counter() - wall, time.process_time() - cpu)


def clouds_of(category: str, count: int) -> Float[np.ndarray, "count n 3"]:
    """What a camera sees of a category's typical object: `MAX_POINTS` points with 1 mm of noise [m]."""
    shape, rng = template(category), np.random.default_rng(0)
    clouds = np.empty((count, MAX_POINTS, 3), np.float32)
    for cloud, turn in zip(clouds, Rotation.random(count, random_state=0).as_matrix(), strict=True):
        points = shape.points @ turn.T + [0.0, 0.0, 0.7]
        seen = np.flatnonzero(np.sum(shape.normals @ turn.T * points, axis=1) < 0)
        rows = rng.choice(seen, MAX_POINTS, replace=len(seen) < MAX_POINTS)
        cloud[:] = points[rows] + 1e-3 * rng.standard_normal((MAX_POINTS, 3))
    return clouds


def one_by_one(estimator: PoseEstimator, category: str) -> list[Row]:
    """A row for ours, for CPPF as published and for the matcher, if it is there."""
    clouds, key = clouds_of(category, OBJECTS), jax.random.key(0)
    config = CppfConfig(reach=(0.12, 0.12), mean_log_extents=(-2.5, -2.5, -2.5))
    published = CppfModel(config, rng=np.random.default_rng(0))
    cppf = PoseEstimator(TrainedModel(published, (category,)))
    methods: dict[str, Callable[[np.ndarray], object]] = {
        NORMALS: cloud_normals,
        "ours": lambda cloud: estimator.estimate(cloud, key=key),
        "CPPF as published": lambda cloud: cppf.estimate(cloud, key=key),
    }
    matchers, lacking = available()
    if MATCHER in matchers:
        match = matchers[MATCHER](template(category))
        methods[MATCHER] = lambda cloud: match(cloud, cloud_normals(cloud))
    else:
        print(f"{MATCHER}: left out ({lacking[MATCHER]})", file=sys.stderr)
    spent: dict[str, list[Spent]] = {name: [] for name in methods}
    for work in methods.values():
        work(clouds[0])  # compiles
    for turn, cloud in enumerate(clouds):
        for name, work in methods.items():
            if name in ("ours", NORMALS) or turn % (OBJECTS // SLOW_OBJECTS) == 0:
                spent[name].append(timed(lambda work=work, cloud=cloud: work(cloud)))
    rows = []
    for name, each in spent.items():
        wall, cpu = (1e3 * float(np.median([getattr(s, k) for s in each])) for k in ("wall", "cpu"))
        rows.append({"part": "one", "method": name, "ms": wall, "cpu_ms": cpu, "n": len(each)})
    ours = next(row["cpu_ms"] for row in rows if row["method"] == "ours")
    return [{**row, "times_ours": row["cpu_ms"] / ours} for row in rows]


def batched(model: PoseModel, category: str) -> Row:
    """Objects a second in batches of `BATCH`, and the memory that it takes."""
    batch = _batch(category, BATCH)
    found, compiling = _compiled(model, batch)
    spent = [timed(found).wall for _ in range(1 if jax.default_backend() == "cpu" else 5)]
    stats = jax.local_devices()[0].memory_stats() or {}
    peak = stats.get("peak_bytes_in_use", 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    return {
        "part": "batch",
        "objects": BATCH,
        "at_once": model.at_once,
        "objects_per_s": BATCH / float(np.median(spent)),
        "peak_gb": peak / 1e9,
        "peak_of": "device" if stats else "process",
        "compiling_s": compiling,
    }


def against_pairs(model: PoseModel, category: str, known: Row | None) -> list[Row]:
    """Time for each number of pairs: of one object on a CPU, of a batch, maybe `known`, elsewhere."""
    on_cpu = jax.default_backend() == "cpu"
    batch = _batch(category, 1 if on_cpu else BATCH)
    rows = []
    for pairs in PAIRS if on_cpu else PAIRS[:3]:
        if known is not None and not on_cpu and pairs == model.config.pairs:
            ms = 1e3 * BATCH / known["objects_per_s"]
            rows.append({"part": "pairs", "pairs": pairs, "objects": BATCH, "ms": ms})
            continue
        found, _ = _compiled(_with_pairs(model, pairs), batch)
        each = [timed(found) for _ in range(20 if on_cpu else 5)]
        ms = 1e3 * float(np.median([s.cpu if on_cpu else s.wall for s in each]))
        rows.append({"part": "pairs", "pairs": pairs, "objects": len(batch[0]), "ms": ms})
    return rows


def linear_fit(rows: Sequence[Row]) -> tuple[float, float, float]:
    """Constant [ms], slope [ms per 1,000 pairs], and the largest deviation as a share of the time."""
    pairs, ms = (np.array([row[name] for row in rows], float) for name in ("pairs", "ms"))
    slope, constant = np.polyfit(pairs / 1000, ms, 1, w=1 / ms)
    off = np.abs(constant + slope * pairs / 1000 - ms) / ms
    return float(constant), float(slope), float(off.max())


def _batch(category: str, count: int) -> tuple[jax.Array, jax.Array, jax.Array]:
    clouds = clouds_of(category, min(count, 32))
    normals = np.stack([cloud_normals(cloud) for cloud in clouds])
    repeats = (-(-count // len(clouds)), 1, 1)
    points = np.tile(clouds, repeats)[:count]
    mask = np.ones(points.shape[:2], bool)
    return jnp.asarray(points), jnp.asarray(np.tile(normals, repeats)[:count]), jnp.asarray(mask)


def _compiled(
    model: PoseModel, batch: tuple[jax.Array, jax.Array, jax.Array]
) -> tuple[Callable[[], object], float]:
    """The batch's estimate, ready to run, and the seconds it took to compile."""
    key, begin = jax.random.key(0), time.perf_counter()
    run: Any = eqx.filter_jit(estimate_batch).lower(model, *batch, key=key).compile()
    took = time.perf_counter() - begin
    jax.block_until_ready(batch)
    return lambda: run(model, *batch, key=key), took


def _with_pairs(model: PoseModel, pairs: int) -> PoseModel:
    blank = PoseModel(replace(model.config, pairs=pairs), rng=np.random.default_rng(0))
    return jax.tree.unflatten(jax.tree.structure(blank), jax.tree.leaves(model))


def main(argv: Sequence[str] | None = None) -> int:
    """Print the figures; returns the exit code."""
    compile_at_once_on_gpus()
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--category", default="cup")
    parser.add_argument("--weights", type=Path, metavar="FILE")
    parser.add_argument("--parts", nargs="+", choices=PARTS)
    parser.add_argument("--at-once", type=int, metavar="N", help="clouds in memory together")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args(argv)
    parts = options.parts or (PARTS if jax.default_backend() == "cpu" else PARTS[1:])
    try:
        check_categories([options.category])
        check_files(options.json)
        if options.weights is None:
            estimator = PoseEstimator.load(options.category)
        else:
            estimator = PoseEstimator.from_file(options.weights, method="ours")
    except InputError as error:
        print(f"pose_speed: {error}", file=sys.stderr)
        return 2
    model = estimator.trained.model
    assert isinstance(model, PoseModel)
    if options.at_once is not None:
        PoseModel.at_once = options.at_once
    print(f"{machine()}; JAX {jax.__version__} on {jax.devices()[0].device_kind}")
    rows: list[Row] = []
    if "batch" in parts:  # first: the peak of memory is this part's own
        rows.append(batched(model, options.category))
        print(
            "batches of {objects}, {at_once} at once: {objects_per_s:.0f} objects/s, peak {peak_gb:.2f} GB "
            "of the {peak_of}, compiled in {compiling_s:.0f} s".format(**rows[-1])
        )
    if "one" in parts:
        for row in one_by_one(estimator, options.category):
            rows.append(row)
            print(
                "one object, {method}: {ms:.1f} ms, {cpu_ms:.1f} ms of CPU time (median of {n}), "
                "{times_ours:.1f} times ours".format(**row)
            )
    if "pairs" in parts:
        known = next((row for row in rows if row["part"] == "batch"), None)
        measured = against_pairs(model, options.category, known)
        rows += measured
        for row in measured:
            print("{pairs} pairs, {objects} objects: {ms:.2f} ms".format(**row))
        constant, slope, off = linear_fit(measured)
        print(f"fit: {constant:.2f} ms + {slope:.2f} ms per 1,000 pairs, within {off:.1%}")
        rows.append({"part": "fit", "ms": constant, "ms_per_1000_pairs": slope, "off": off})
    if options.json is not None:
        try:
            write_rows(options.json, rows)
        except InputError as error:
            print(f"pose_speed: {error}", file=sys.stderr)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
