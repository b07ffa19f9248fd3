"""The built-in catalogue: objects with exact labels, built on first use into a cache folder.

What there is stands in `categories`. This module is the one door to `asset_pipeline`, which generates and
builds the objects: it is loaded when an object is made, not before.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from manipose_mj.assets.asset import ASSET_FILE, Asset, StablePose
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.assets.categories import (
    CATALOGUE,
    SPLITS,
    Category,
    Split,
    cached,
    category_row,
    code_hash,
    entries,
    find,
    instances,
    is_built,
    names,
)
from manipose_mj.errors import InputError
from manipose_mj.storage.cache_root import CACHE_VARIABLE
from manipose_mj.storage.staging import staging

if TYPE_CHECKING:
    from asset_pipeline.procedural.specimen import Specimen
    from asset_pipeline.procedural.synthetic_furniture.furniture import SyntheticFurniture

__all__ = [
    "CATALOGUE",
    "SPLITS",
    "STABLE_POSES_MODULE",
    "SYNTHETIC_FURNITURE_MODULE",
    "Category",
    "Split",
    "cached",
    "category_row",
    "code_hash",
    "draft",
    "entries",
    "find",
    "generate",
    "instances",
    "is_built",
    "load",
    "load_by_name",
    "names",
    "stable_poses",
    "synthetic_furniture",
]

STABLE_POSES_MODULE = "asset_pipeline.geometry.stable_poses"  # whose code `stable_poses` is
SYNTHETIC_FURNITURE_MODULE = "asset_pipeline.procedural.synthetic_furniture.furniture"


def load(category: str, index: int = 0) -> Asset:
    """An object of the catalogue, built if the cache does not hold it yet.

    Args:
      category: One of `names()`.
      index: Which one; 0 is the typical specimen.

    Raises:
      InputError: There is no such category or index, or the cache cannot be written.
    """
    row = category_row(category)
    if not 0 <= index < row.instances:
        raise InputError(
            f"no {category} with index {index}; the catalogue has 0 to {row.instances - 1}"
        )
    folder = cached(category, index)
    if not is_built(category, index):
        _fill_cache(row, index, folder)
    return read_asset(folder)


def load_by_name(name: str) -> Asset:
    """An object of the catalogue by its name, such as `"mug_003"`.

    Raises:
      InputError: There is none of this name; the nearest ones are offered.
    """
    return load(*find(name))


def generate(category: str, index: int) -> Specimen:
    """Shapes, label and parts of an object; any natural number, also beyond the built-in instances.

    Raises:
      InputError: There is no such category.
    """
    from asset_pipeline.catalogue.instance import generate

    return generate(category_row(category), index)


def stable_poses(specimen: Specimen) -> tuple[StablePose, ...]:
    """The ways in which a rigid object that was generated rests on a horizontal plane."""
    from asset_pipeline.geometry.stable_poses import stable_poses

    body = specimen.bodies[0]
    center = body.mass_properties.center_of_mass
    return stable_poses(body.surface(), center, label=specimen.label)


def synthetic_furniture(index: int) -> SyntheticFurniture:
    """A piece of furniture that is only to train on; any natural number."""
    from asset_pipeline.procedural.synthetic_furniture.furniture import synthetic_furniture

    return synthetic_furniture(index)


def draft(category: str, index: int, folder: Path) -> Asset:
    """Write the visuals of an object into `folder`, for pictures; it is no asset folder.

    Raises:
      InputError: There is no such category.
    """
    from asset_pipeline.catalogue.draft import draft

    return draft(category_row(category), index, folder)


def _fill_cache(row: Category, index: int, folder: Path) -> None:
    """Build aside, then move in place; whoever builds the same at the same time keeps the first."""
    try:
        with staging(folder) as scratch:
            built = _build(row, index, scratch / folder.name)
            try:
                os.rename(built.folder, folder)
            except OSError:
                if not (folder / ASSET_FILE).is_file():
                    raise
    except OSError as error:
        raise InputError(
            f"cannot write the catalogue's cache {folder.parent}: {error.strerror or error}; "
            f"set {CACHE_VARIABLE} to a folder with room that can be written"
        ) from None


def _build(row: Category, index: int, folder: Path) -> Asset:
    from asset_pipeline.catalogue.instance import build

    return build(row.name, index, folder)
