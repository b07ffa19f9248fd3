"""Clouds of the catalogue's objects, rendered once into a cache folder and streamed as batches.

A file holds some views of one object and depends on nothing but the object, the setting, the number of
the file and the code, so that any number of processes can write them in any order.
"""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path

import joblib
import numpy as np

from manipose_mj.assets import catalogue
from manipose_mj.assets.categories import CATALOGUE, Split, instances
from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.data.augmentation.tapering import taperable, tapered
from manipose_mj.ppf_jax.data.occlusion import Occluder
from manipose_mj.ppf_jax.data.rendering import Subject, render_clouds
from manipose_mj.ppf_jax.data.source_frames import SourceLabel, label_bounds, source_label
from manipose_mj.ppf_jax.data.view_settings import ViewSetting
from manipose_mj.ppf_jax.points.cloud_files import read_clouds, write_clouds
from manipose_mj.ppf_jax.points.clouds import (
    SAMPLE_POINTS,
    CloudBatch,
    LabelledCloud,
    batch_clouds,
    most_members,
)
from manipose_mj.storage.cache_root import cache_root
from manipose_mj.storage.source_hash import source_hash

VIEWS_PER_FILE = 32
FORMAT = 1  # of the files, and of how this module seeds them
_OCCLUDERS = 3  # other objects of the catalogue that may stand in front of one

Report = Callable[[int, int, str], None]  # done, of how many, the last one's name


def catalogue_clouds(
    category: str,
    split: Split,
    setting: ViewSetting,
    *,
    views: int,
    jobs: int = 1,
    progress: Report | None = None,
) -> list[LabelledCloud]:
    """Views of every object of a category in a split, by object and view; what is missing is rendered.

    The same on every machine, and of the first `views` views whatever was asked for before.

    Args:
      category: Of the catalogue.
      split: `"train"` or `"test"`.
      setting: From where, and how well.
      views: Of each object.
      jobs: Processes.
      progress: Told of every finished object.

    Raises:
      InputError: There is no such category, or the cache cannot be written.
    """
    names = instances(category)
    row = CATALOGUE[category]
    if row.object_type == "articulated":
        raise InputError(f"{category} is articulated; clouds are rendered of rigid categories only")
    if views < 1:
        raise InputError(f"{views} views of each object; expected at least 1")
    requested = [index for index in range(len(names)) if row.split(index) == split]
    work = joblib.Parallel(n_jobs=jobs, return_as="generator")(
        joblib.delayed(_fill)(category, index, setting, views) for index in requested
    )
    for done, index in enumerate(work, 1):
        if progress is not None:
            progress(done, len(requested), names[index])
    return [cloud for index in requested for cloud in _read(category, index, setting, views)]


def batch_stream(
    clouds: Sequence[LabelledCloud], batch: int, seed: int, *, points: int = SAMPLE_POINTS
) -> Callable[[int], Iterator[CloudBatch]]:
    """Batches of one shape without end, from any step on; each depends on the seed and its step only.

    Every cloud comes once before any comes again; a round may end within a batch.

    Args:
      clouds: To draw from.
      batch: Clouds in a batch.
      seed: Of the order and the points.
      points: Of each cloud.

    Raises:
      InputError: There are no clouds.
    """
    if not clouds:
        raise InputError("no clouds to stream; expected at least one")
    members, count = most_members(clouds), len(clouds)

    @lru_cache(maxsize=2)
    def order(round_: int) -> np.ndarray:
        return np.random.default_rng([seed, 0, round_]).permutation(count)

    def batches(start: int) -> Iterator[CloudBatch]:
        for step in itertools.count(start):
            places = range(step * batch, (step + 1) * batch)
            chosen = [clouds[order(place // count)[place % count]] for place in places]
            rng = np.random.default_rng([seed, 1, step])
            yield batch_clouds(chosen, rng=rng, points=points, members=members)

    return batches


def catalogue_subject(category: str, index: int, *, resting: bool, taper: float = 0.0) -> Subject:
    """An object of the catalogue, ready to be rendered.

    Args:
      category: Of the catalogue.
      index: Which object.
      resting: Whether its resting poses are needed, which take longer than the rest.
      taper: How much wider its upper end is drawn than it is, as a share; of what can be
        tapered (`tapering.py`) and does not rest.
    """
    row = CATALOGUE[category]
    specimen = catalogue.generate(category, index)
    body, label = specimen.bodies[0], specimen.label
    surface, shapes = body.surface(), body.visual
    poses = catalogue.stable_poses(specimen) if resting else ()
    rests = [(pose.rotation, pose.height, pose.probability) for pose in poses]
    if taper and taperable(label):
        (surface, label), shapes = tapered(surface, label, taper), ()
    name = row.instance(index)
    return Subject.of_mesh(surface, label, name=name, category=category, rests=rests, shapes=shapes)


def source_labels(clouds: Sequence[LabelledCloud], *, jobs: int = 1) -> dict[str, SourceLabel]:
    """The frames that the catalogue objects seen in clouds have from their sources, by their names."""
    owners = {cloud.name.split("/")[0]: cloud.category for cloud in clouds}
    found = joblib.Parallel(n_jobs=jobs)(
        joblib.delayed(_source_label)(category, name) for name, category in owners.items()
    )
    return dict(zip(owners, found, strict=True))  # pyright: ignore[reportReturnType]


def _source_label(category: str, name: str) -> SourceLabel:
    specimen = catalogue.generate(category, int(name.removeprefix(f"{category}_")))
    vertices = np.asarray(specimen.bodies[0].surface().vertices)
    return source_label(name, specimen.label, label_bounds(specimen.label, vertices))


def cache_folder(category: str, setting: ViewSetting) -> Path:
    """Where the views of a category are kept: under `$MANIPOSE_CACHE`, else `~/.cache/manipose-mj`."""
    return cache_root() / "clouds" / f"{category}-{setting.name}-{_code_hash(category, setting)}"


@cache
def _code_hash(category: str, setting: ViewSetting) -> str:
    # Only what shapes and pictures come from: not all that builds assets.
    modules = [render_clouds.__module__, tapered.__module__, CATALOGUE[category].module]
    if setting.placement != "anywhere":
        modules.append(catalogue.STABLE_POSES_MODULE)
    values = repr(replace(setting, name=""))  # its name is in the folder's
    return source_hash(modules, values, version("numpy"), str(FORMAT))


def _file(category: str, index: int, setting: ViewSetting, number: int) -> Path:
    name = CATALOGUE[category].instance(index)
    return cache_folder(category, setting) / f"{name}-{number:03d}.npz"


def _files(category: str, index: int, setting: ViewSetting, views: int) -> list[Path]:
    return [_file(category, index, setting, i) for i in range(-(-views // VIEWS_PER_FILE))]


def _fill(category: str, index: int, setting: ViewSetting, views: int) -> int:
    """Render what is missing of one object; returns its index."""
    files = _files(category, index, setting, views)
    missing = [number for number, path in enumerate(files) if not path.is_file()]
    if missing:
        name, resting = CATALOGUE[category].instance(index), setting.placement != "anywhere"
        subject = catalogue_subject(category, index, resting=resting)
        occluders = catalogue_occluders(zlib.crc32(name.encode())) if setting.occluded else []
        for number in missing:
            # Not the setting: the tables' settings show the same objects in the same random order.
            seed = [zlib.crc32(name.encode()), number]
            rng = np.random.default_rng(seed)
            if setting.taper:
                taper = np.random.default_rng([*seed, 1]).uniform(-setting.taper, setting.taper)
                subject = catalogue_subject(category, index, resting=resting, taper=taper)
            first = number * VIEWS_PER_FILE
            clouds = render_clouds(
                subject, setting, VIEWS_PER_FILE, rng, occluders=occluders, first=first
            )
            write_clouds(files[number], clouds)
    return index


def catalogue_occluders(seed: int) -> list[Occluder]:
    """Typical objects of some rigid categories."""
    rng = np.random.default_rng(seed)
    rigid = [row for row in CATALOGUE.values() if row.object_type != "articulated"]
    chosen = rng.choice(len(rigid), _OCCLUDERS, replace=False)
    return [
        Occluder.of_mesh(catalogue.generate(rigid[i].name, 0).bodies[0].surface()) for i in chosen
    ]


def _read(category: str, index: int, setting: ViewSetting, views: int) -> list[LabelledCloud]:
    name, clouds = CATALOGUE[category].instance(index), []
    for path in _files(category, index, setting, views):
        clouds += read_clouds(path, name, category, first=len(clouds))
    return clouds[:views]
