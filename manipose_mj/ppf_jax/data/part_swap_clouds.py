"""Clouds of objects that are made of two, for training networks of whole types."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path

import joblib
import numpy as np

from manipose_mj.assets import catalogue
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.data.augmentation.part_swap import Whole, part_swappable, part_swapped
from manipose_mj.ppf_jax.data.rendering import Subject, render_clouds
from manipose_mj.ppf_jax.data.view_cache import VIEWS_PER_FILE, Report, catalogue_occluders
from manipose_mj.ppf_jax.data.view_settings import ViewSetting
from manipose_mj.ppf_jax.points.cloud_files import read_clouds, write_clouds
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.storage.cache_root import cache_root
from manipose_mj.storage.source_hash import source_hash

CATEGORY, ASSET_CATEGORY = "part_swap", "asset_part_swap"  # of the clouds; of no catalogue
_SEED = 0x2E250DD2  # another number would make other objects than estimators were trained on
_DRAWS = 200  # of two objects, most of which go together


def part_swap_clouds(
    categories: Sequence[str],
    count: int,
    setting: ViewSetting,
    *,
    jobs: int = 1,
    progress: Report | None = None,
) -> list[LabelledCloud]:
    """`VIEWS_PER_FILE` views of each of `count` objects made of two training objects (`part_swap.py`).

    The same on every machine; object `i` depends on the categories and on `i` only.

    Args:
      categories: Of the catalogue and of one type, at least two; the two objects are of different ones.
      count: How many objects.
      setting: From where, and how well; none on a table.
      jobs: Processes.
      progress: Told of every finished object.

    Raises:
      InputError: There are fewer than two categories whose ends can be told apart, a setting
        needs resting poses, or the cache cannot be written.
    """
    donors = _swappable(categories)
    if len(donors) < 2:
        raise InputError(
            f"objects are made of two of {', '.join(categories)}; expected at least two categories "
            "whose ends can be told apart"
        )
    _require_no_table(setting)
    work = joblib.Parallel(n_jobs=jobs, return_as="generator")(
        joblib.delayed(_fill)(donors, number, setting) for number in range(count)
    )
    for done, name in enumerate(work, 1):
        if progress is not None:
            progress(done, count, str(name))
    files = [_file(donors, number, setting) for number in range(count)]
    return [cloud for path in files for cloud in read_clouds(path, path.stem, CATEGORY)]


def asset_part_swap_clouds(
    wholes: Sequence[Whole],
    categories: Sequence[str],
    count: int,
    setting: ViewSetting,
    *,
    jobs: int = 1,
    progress: Report | None = None,
) -> list[LabelledCloud]:
    """`VIEWS_PER_FILE` views of each of `count` objects made of an asset and another asset or training object.

    Either may be the lower one. Nothing is kept in the cache.

    Args:
      wholes: Of the assets, of one type.
      categories: Of the catalogue and of the same type.
      count: How many objects.
      setting: From where, and how well; none on a table.
      jobs: Processes.
      progress: Told of every finished object.

    Raises:
      InputError: No asset has ends that can be told apart, hardly any two objects go together, or a setting needs
        resting poses.
    """
    assets = [whole for whole in wholes if part_swappable(whole.label)]
    donors = _swappable(categories)
    if not assets:
        raise InputError("objects are made of two; the assets' ends cannot be told apart")
    _require_no_table(setting)
    work = joblib.Parallel(n_jobs=jobs, return_as="generator")(
        joblib.delayed(_asset_part_swap)(assets, donors, number, setting) for number in range(count)
    )
    clouds: list[LabelledCloud] = []
    for done, some in enumerate(work, 1):
        clouds += some  # pyright: ignore[reportOperatorIssue]
        if progress is not None:
            progress(done, count, f"{ASSET_CATEGORY}_{done:05d}")
    return clouds


def _swappable(categories: Sequence[str]) -> tuple[str, ...]:
    return tuple(sorted(c for c in categories if part_swappable(catalogue.generate(c, 0).label)))


def _require_no_table(setting: ViewSetting) -> None:
    if setting.placement != "anywhere":
        raise InputError(
            f"setting {setting.name!r} needs resting poses, which objects made of two lack"
        )


def _asset_part_swap(
    assets: Sequence[Whole], donors: Sequence[str], number: int, setting: ViewSetting
) -> list[LabelledCloud]:
    rng = np.random.default_rng([_SEED, 1, number])
    for _ in range(_DRAWS):
        one = assets[int(rng.integers(len(assets)))]
        if donors and rng.random() < 0.5:
            other = _training_object(donors[int(rng.integers(len(donors)))], rng)
        else:
            other = assets[int(rng.integers(len(assets)))]
        if other is one or not part_swappable(other.label):
            continue
        pair = (one, other) if rng.random() < 0.5 else (other, one)
        found = part_swapped(*pair, rng)
        if found is not None:
            name = f"{ASSET_CATEGORY}_{number:05d}"
            subject = Subject.of_mesh(found.mesh, found.label, name=name, category=ASSET_CATEGORY)
            occluders = catalogue_occluders(number) if setting.occluded else []
            return render_clouds(subject, setting, VIEWS_PER_FILE, rng, occluders=occluders)
    raise InputError(f"of {_DRAWS} pairs of {len(assets)} assets and others none goes together")


def part_swap_subject(donors: Sequence[str], number: int) -> Subject:
    """Object `number` that is made of two training objects of different categories.

    Raises:
      InputError: Hardly any two of these categories go together.
    """
    rng = np.random.default_rng([_SEED, number])
    for _ in range(_DRAWS):
        first, second = rng.choice(len(donors), 2, replace=False)
        lower, upper = (_training_object(donors[int(i)], rng) for i in (first, second))
        if not (part_swappable(lower.label) and part_swappable(upper.label)):
            continue
        found = part_swapped(lower, upper, rng)
        if found is not None:
            name = f"{CATEGORY}_{number:05d}"
            return Subject.of_mesh(found.mesh, found.label, name=name, category=CATEGORY)
    raise InputError(f"of {_DRAWS} pairs of {', '.join(donors)} none goes together")


def _training_object(category: str, rng: np.random.Generator) -> Whole:
    row = CATALOGUE[category]
    indices = [index for index in range(row.instances) if row.split(index) == "train"]
    specimen = catalogue.generate(row.name, int(rng.choice(indices)))
    return Whole(specimen.bodies[0].surface(), specimen.label)


def _fill(donors: tuple[str, ...], number: int, setting: ViewSetting) -> str:
    """Render the views of one object if they are missing; returns its name."""
    path = _file(donors, number, setting)
    if not path.is_file():
        seed = zlib.crc32(f"_{number:05d}".encode(), _SEED)
        rng = np.random.default_rng([seed, 1])
        subject = part_swap_subject(donors, number)
        occluders = catalogue_occluders(seed) if setting.occluded else []
        clouds = render_clouds(subject, setting, VIEWS_PER_FILE, rng, occluders=occluders)
        write_clouds(path, clouds)
    return path.stem


def _file(donors: tuple[str, ...], number: int, setting: ViewSetting) -> Path:
    folder = f"{CATEGORY}-{setting.name}-{_code_hash(donors, setting)}"
    return cache_root() / "clouds" / folder / f"{CATEGORY}_{number:05d}.npz"


@cache
def _code_hash(donors: tuple[str, ...], setting: ViewSetting) -> str:
    modules = [render_clouds.__module__, part_swapped.__module__]
    modules += sorted({CATALOGUE[category].module for category in donors})
    return source_hash(modules, repr(donors), repr(setting), version("numpy"))
