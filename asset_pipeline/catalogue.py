"""The built-in catalogue: procedural objects with exact labels, built on first use into a cache folder.

An instance is named for its category and index, `mug_003`. The same index is the same object on every
machine; index 0 of a category is its typical specimen, the others vary sizes, shape and colour.
"""

from __future__ import annotations

import logging
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from asset_pipeline.asset_json import read_asset
from asset_pipeline.assets import ASSET_FILE, Asset, Provenance
from asset_pipeline.emit import write_asset
from asset_pipeline.finish import finish_rigid
from asset_pipeline.labelling.label import ObjectType
from asset_pipeline.procedural import bowl, box, cabinet, chips_can, mug
from asset_pipeline.procedural.specimen import Specimen
from asset_pipeline.source_hash import source_hash
from manipose_mj.errors import InputError, unknown_name

log = logging.getLogger(__name__)

CACHE_VARIABLE = "MANIPOSE_CACHE"
LICENCE = "Apache-2.0"


@dataclass(frozen=True)
class Category:
    """One row of the catalogue.

    Attributes:
      name: The category, which estimators are told.
      object_type: The labelling rule of its objects.
      generate: From an index to the object.
      instances: How many are built in.
    """

    name: str
    object_type: ObjectType
    generate: Callable[[int], Specimen]
    instances: int = 10

    def instance(self, index: int) -> str:
        """The asset's name of an instance."""
        return f"{self.name}_{index:03d}"


CATALOGUE: dict[str, Category] = {
    category.name: category
    for category in (
        Category("chips_can", "axial", chips_can.generate),
        Category("mug", "mirror", mug.generate),
        Category("box", "mirror", box.generate),
        Category("bowl", "axial", bowl.generate),
        Category("cabinet", "articulated", cabinet.generate),
    )
}


def names() -> tuple[str, ...]:
    """The categories."""
    return tuple(CATALOGUE)


def instances(category: str) -> tuple[str, ...]:
    """The names of a category's objects, by index.

    Raises:
      InputError: There is no such category.
    """
    row = _category(category)
    return tuple(row.instance(index) for index in range(row.instances))


def load(category: str, index: int = 0) -> Asset:
    """An object of the catalogue, built if the cache does not hold it yet.

    Args:
      category: One of `names()`.
      index: Which one; 0 is the typical specimen.

    Raises:
      InputError: There is no such category or index, or the cache cannot be written.
    """
    row = _category(category)
    if not 0 <= index < row.instances:
        raise InputError(
            f"no {category} with index {index}; the catalogue has 0 to {row.instances - 1}"
        )
    folder = cache_folder() / row.instance(index)
    if not (folder / ASSET_FILE).is_file():
        _fill_cache(row, index, folder)
    return read_asset(folder)


def load_by_name(name: str) -> Asset:
    """An object of the catalogue by its name, such as `"mug_003"`.

    Raises:
      InputError: There is none of this name; the nearest ones are offered.
    """
    found = dict(_entries())
    if name not in found:
        raise unknown_name("built-in object", name, found)
    return load(*found[name])


def build(category: str, index: int, folder: Path) -> Asset:
    """Generate an object and write its asset folder.

    Args:
      category: One of `names()`.
      index: Which one; any natural number, also beyond the built-in instances.
      folder: Where to write; replaced whole if it is there.
    """
    row = _category(category)
    name = row.instance(index)
    log.info("building %s into %s", name, folder)
    specimen = row.generate(index)
    provenance = Provenance(
        source="procedural catalogue",
        item=name,
        licence=LICENCE,
        generator=f"asset_pipeline.procedural.{category}",
    )
    up = np.array([0.0, 0.0, 1.0])
    if not specimen.parts:
        return finish_rigid(
            folder,
            name=name,
            category=category,
            label=specimen.label,
            up=up,
            body=specimen.bodies[0],
            provenance=provenance,
        )
    asset = Asset(
        folder=Path(folder),
        name=name,
        kind="articulated",
        category=category,
        label=specimen.label,
        up=up,
        # Of the base; the moving parts have theirs in the model.
        mass_properties=specimen.bodies[0].mass_properties,
        stable_poses=(),
        provenance=provenance,
        parts=specimen.parts,
    )
    return write_asset(asset, specimen.bodies)


def cache_folder() -> Path:
    """Where built objects are kept: under `$MANIPOSE_CACHE`, else `~/.cache/manipose-mj`.

    One folder for each version of the code that builds, so a change of code builds anew.
    """
    root = os.environ.get(CACHE_VARIABLE)
    home = Path(root) if root else Path.home() / ".cache" / "manipose-mj"
    return home / "catalogue" / _code_hash()


def _category(name: str) -> Category:
    if name not in CATALOGUE:
        raise unknown_name("category", name, CATALOGUE)
    return CATALOGUE[name]


def _entries() -> Iterator[tuple[str, tuple[str, int]]]:
    for row in CATALOGUE.values():
        for index in range(row.instances):
            yield row.instance(index), (row.name, index)


def _fill_cache(row: Category, index: int, folder: Path) -> None:
    """Build aside, then move in place; whoever builds the same at the same time keeps the first."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".building-", dir=folder.parent) as staging:
            built = build(row.name, index, Path(staging) / folder.name)
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


@cache
def _code_hash() -> str:
    return source_hash(__name__, version("mujoco"))
