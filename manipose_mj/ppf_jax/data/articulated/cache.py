"""Scenes of furniture, rendered once into a cache folder and streamed to training.

A file holds some scenes of one object and depends on nothing but the object, the setting, the number of the
file and the code.
"""

from __future__ import annotations

import itertools
import pickle
import zlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from functools import cache
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import joblib
import numpy as np

from manipose_mj.assets.catalogue import CATALOGUE, SYNTHETIC_FURNITURE_MODULE, Split
from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.data.articulated.clouds import (
    FurnitureBatch,
    FurnitureCloud,
    FurnitureScene,
    batch_furniture,
    fused_cloud,
)
from manipose_mj.ppf_jax.data.articulated.subject import (
    CATEGORIES,
    SYNTHETIC,
    ArticulatedSubject,
    catalogue_furniture,
    synthetic_furniture,
)
from manipose_mj.ppf_jax.data.articulated.views import (
    FURNITURE_SETTINGS,
    FurnitureSetting,
    random_openings,
    render_furniture,
)
from manipose_mj.ppf_jax.data.view_cache import Report
from manipose_mj.storage.cache_file import new_cache_file
from manipose_mj.storage.cache_root import cache_root
from manipose_mj.storage.source_hash import source_hash

SCENES_PER_FILE = 4
FRONT_VIEWS = 3  # of each scene
FORMAT = 2  # of the files, and of how this module seeds them
_SEEDS = {SYNTHETIC: "home"}  # another word would draw other views than estimators were trained on
_SINGLE, _TWO = 0.7, 0.85  # shares of clouds of one view; of one or two


def furniture_names(split: Split, further: int = 0, synthetic: int = 0) -> list[tuple[str, int]]:
    """Category and index of the articulated objects in a split.

    Args:
      split: Of the catalogue.
      further: For training, so many more of each category, beyond the built-in ones.
      synthetic: For training, so many pieces of synthetic furniture.
    """
    found = []
    for category in CATEGORIES:
        row = CATALOGUE[category]
        found += [(category, i) for i in range(row.instances) if row.split(i) == split]
        found += [(category, row.instances + i) for i in range(further)]
    return found + [(SYNTHETIC, i) for i in range(synthetic)]


def _subject(category: str, index: int) -> ArticulatedSubject:
    if category == SYNTHETIC:
        return synthetic_furniture(index)
    return catalogue_furniture(category, index)


def furniture_scenes(
    objects: Sequence[tuple[str, int]],
    setting: str,
    *,
    scenes: int,
    jobs: int = 1,
    progress: Report | None = None,
) -> list[FurnitureScene]:
    """Scenes of catalogue objects, by object; what is missing is rendered.

    Args:
      objects: Category and index of each.
      setting: A name in `FURNITURE_SETTINGS`.
      scenes: Of each object.
      jobs: Processes.
      progress: Told of every finished object.

    Raises:
      InputError: The cache cannot be written.
    """
    work = joblib.Parallel(n_jobs=jobs, return_as="generator")(
        joblib.delayed(_fill)(*each, setting, scenes) for each in objects
    )
    for done, name in enumerate(work, 1):
        if progress is not None:
            progress(done, len(objects), name)
    return [scene for each in objects for scene in _read(*each, setting, scenes)]


def random_scene(
    subject: ArticulatedSubject, setting: FurnitureSetting, number: int, rng: np.random.Generator
) -> FurnitureScene:
    """One scene: `FRONT_VIEWS` views from before the front; every other one, one from anywhere around."""
    openings = random_openings(subject, setting, rng)
    views = [render_furniture(subject, openings, setting, rng) for _ in range(FRONT_VIEWS)]
    if number % 2:
        views.append(render_furniture(subject, openings, setting, rng, placement="around"))
    return FurnitureScene(
        name=f"{subject.name}/{number}",
        category=subject.category,
        label=subject.label.pose,
        joints=subject.joints,
        openings=openings,
        views=tuple(views),
    )


def furniture_stream(
    scenes: Sequence[FurnitureScene], batch: int, seed: int
) -> Callable[[int], Iterator[FurnitureBatch]]:
    """Batches of one shape without end, from any step on; each depends on the seed and its step only.

    Raises:
      InputError: There are no scenes.
    """
    if not scenes:
        raise InputError("no scenes to stream; expected at least one")

    def batches(start: int) -> Iterator[FurnitureBatch]:
        for step in itertools.count(start):
            yield _batch(scenes, batch, seed, step)

    return batches


def parallel_furniture_stream(
    objects: Sequence[tuple[str, int]],
    setting: str,
    *,
    scenes: int,
    batch: int,
    seed: int,
    jobs: int,
    others: Sequence[FurnitureScene] = (),
) -> Callable[[int], Iterator[FurnitureBatch]]:
    """The batches of `furniture_stream`, made ahead by other processes: a GPU takes them faster than one can.

    Args:
      objects: Category and index of each, whose scenes are in the cache.
      setting: A name in `FURNITURE_SETTINGS`.
      scenes: Of each object; every process keeps them all in memory.
      batch: Clouds in a batch.
      seed: Of the clouds and their points.
      jobs: Processes.
      others: Scenes to draw from besides, after those of the objects.
    """

    def batches(start: int) -> Iterator[FurnitureBatch]:
        with TemporaryDirectory(prefix="manipose-scenes-") as scratch:
            # Read by every process, once; a pipe to each would carry gigabytes.
            kept = Path(scratch) / "others.pickle"
            kept.write_bytes(pickle.dumps(list(others)))
            workers = ProcessPoolExecutor(
                jobs, get_context("spawn"), _keep_scenes, (tuple(objects), setting, scenes, kept)
            )
            try:
                ahead: deque[Future[FurnitureBatch]] = deque()
                for step in itertools.count(start):
                    ahead.append(workers.submit(_batch_of_kept, batch, seed, step))
                    if len(ahead) > 3 * jobs:
                        yield ahead.popleft().result()
            finally:
                workers.shutdown(wait=False, cancel_futures=True)

    return batches


_kept: list[FurnitureScene] = []  # of a process that makes batches


def _keep_scenes(
    objects: Sequence[tuple[str, int]], setting: str, scenes: int, others: Path
) -> None:
    _kept[:] = [scene for each in objects for scene in _read(*each, setting, scenes)]
    _kept.extend(pickle.loads(others.read_bytes()))  # written by the process that started this one


def _batch_of_kept(batch: int, seed: int, step: int) -> FurnitureBatch:
    return _batch(_kept, batch, seed, step)


def _batch(scenes: Sequence[FurnitureScene], batch: int, seed: int, step: int) -> FurnitureBatch:
    rng = np.random.default_rng([seed, 1, step])
    chosen = rng.integers(len(scenes), size=batch)
    return batch_furniture([random_cloud(scenes[i], rng) for i in chosen], rng=rng)


def random_cloud(scene: FurnitureScene, rng: np.random.Generator) -> FurnitureCloud:
    """The cloud of one of the front views, sometimes fused with others."""
    first = int(rng.integers(FRONT_VIEWS))
    others = rng.permutation([i for i in range(len(scene.views)) if i != first])
    share = rng.random()
    more = 0 if share < _SINGLE else 1 if share < _TWO else 2
    return fused_cloud(scene, [first, *others[:more]])


def scene_folder(setting: str) -> Path:
    """Where scenes are kept: under `$MANIPOSE_CACHE`, else `~/.cache/manipose-mj`."""
    return cache_root() / "clouds" / f"furniture-{setting}-{_code_hash(setting)}"


@cache
def _code_hash(setting: str) -> str:
    modules = [render_furniture.__module__, SYNTHETIC_FURNITURE_MODULE]
    modules += [CATALOGUE[category].module for category in CATEGORIES]
    values = repr(FURNITURE_SETTINGS[setting])
    return source_hash(modules, values, version("numpy"), str(FORMAT))


def _files(category: str, index: int, setting: str, scenes: int) -> list[Path]:
    count = -(-scenes // SCENES_PER_FILE)
    return [scene_folder(setting) / f"{category}-{index:03d}-{i:03d}.pickle" for i in range(count)]


def _fill(category: str, index: int, setting: str, scenes: int) -> str:
    """Render what is missing of one object; returns its name."""
    files = _files(category, index, setting, scenes)
    missing = [number for number, path in enumerate(files) if not path.is_file()]
    if missing:
        subject = _subject(category, index)
        seed = zlib.crc32(f"{_SEEDS.get(category, category)}_{index:03d}".encode())
        for number in missing:
            rng = np.random.default_rng([seed, number])
            first = number * SCENES_PER_FILE
            rendered = [
                random_scene(subject, FURNITURE_SETTINGS[setting], first + i, rng)
                for i in range(SCENES_PER_FILE)
            ]
            with new_cache_file(files[number]) as path:
                path.write_bytes(pickle.dumps(rendered))
    return f"{category} {index}"


def _read(category: str, index: int, setting: str, scenes: int) -> list[FurnitureScene]:
    # Our own cache, written by `_fill`.
    read = [pickle.loads(p.read_bytes()) for p in _files(category, index, setting, scenes)]
    return [scene for some in read for scene in some][:scenes]
