"""The built-in catalogue: procedural objects with exact labels, built on first use into a cache folder.

An instance is named for its category and index, `mug_003`. The same index is the same object on every
machine; index 0 of a category is its typical specimen, the others vary sizes, shape and colour. Four of
five instances of every category are for training, one is for testing, for ever the same ones.
"""

from __future__ import annotations

import importlib
import logging
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Literal

import numpy as np

from asset_pipeline.asset_json import read_asset
from asset_pipeline.assets import ASSET_FILE, Asset, Provenance
from asset_pipeline.cache_root import CACHE_VARIABLE, cache_root
from asset_pipeline.emit import write_asset
from asset_pipeline.finish import finish_rigid
from asset_pipeline.labelling.label import ObjectType
from asset_pipeline.procedural.specimen import Specimen
from asset_pipeline.source_hash import source_hash
from asset_pipeline.staging import staging
from manipose_mj.errors import InputError, unknown_name

log = logging.getLogger(__name__)

LICENCE = "Apache-2.0"
CODE = "code"  # in an object's provenance: the hash of what built it
TEST_EVERY = 5  # one instance of five is a test object

Split = Literal["train", "test"]
# What the shape of a category maps onto itself under, proper rotations only, as the conventions have
# it; "varies" where instances differ (a square and an oblong box).
Symmetry = Literal["axis", "axis and flip", "none", "half turn", "three half turns", "varies"]


@dataclass(frozen=True)
class Category:
    """One row of the catalogue; its objects come from `generate(index)` of the module it names.

    Attributes:
      name: The category, which estimators are told.
      object_type: The labelling rule of its objects.
      symmetry: Of its objects.
      size: Range of the longest side of the bounding box over real ones [m].
      instances: How many are built in.
    """

    name: str
    object_type: ObjectType
    symmetry: Symmetry
    size: tuple[float, float]
    instances: int

    @property
    def module(self) -> str:
        """Where the generator is."""
        return f"asset_pipeline.procedural.{self.object_type}.{self.name}"

    def generate(self, index: int) -> Specimen:
        """The object of this index; any natural number, also beyond the built-in instances."""
        return importlib.import_module(self.module).generate(index)

    def instance(self, index: int) -> str:
        """The asset's name of an instance."""
        return f"{self.name}_{index:03d}"

    def split(self, index: int) -> Split:
        """Which of the two fixed sets an instance is in."""
        return "test" if index % TEST_EVERY == TEST_EVERY - 1 else "train"


# 56 rigid categories of YCB, OmniObject3D and PACE, 24 of 53 and 32 of 52 instances: 2,936 objects, as
# many as the paper has; and 100 articulated ones. Sizes are of things on sale; sources in each module.
CATALOGUE: dict[str, Category] = {
    row.name: row
    for row in (
        Category("apple", "axial", "axis", (0.063, 0.077), 53),
        Category("bottle", "axial", "axis", (0.15, 0.33), 53),
        Category("bowl", "axial", "axis", (0.11, 0.17), 53),
        Category("can", "axial", "axis", (0.06, 0.17), 53),
        Category("candle", "axial", "axis", (0.04, 0.20), 53),
        Category("chips_can", "axial", "axis", (0.15, 0.255), 53),
        Category("cup", "axial", "axis", (0.07, 0.16), 53),
        Category("flower_pot", "axial", "axis", (0.07, 0.16), 53),
        Category("jar", "axial", "axis", (0.06, 0.20), 53),
        Category("light_bulb", "axial", "axis", (0.08, 0.14), 53),
        Category("pear", "axial", "axis", (0.08, 0.12), 53),
        Category("plate", "axial", "axis", (0.16, 0.28), 53),
        Category("sausage", "axial", "axis and flip", (0.08, 0.20), 53),
        Category("tape", "axial", "axis and flip", (0.045, 0.12), 53),
        Category("thermos", "axial", "axis", (0.17, 0.32), 53),
        Category("trash_bin", "axial", "axis", (0.13, 0.30), 53),
        Category("vase", "axial", "axis", (0.12, 0.30), 53),
        Category("wine_glass", "axial", "axis", (0.14, 0.24), 53),
        Category("box", "mirror", "varies", (0.05, 0.25), 53),
        Category("camera", "mirror", "none", (0.09, 0.15), 53),
        Category("clock", "mirror", "none", (0.07, 0.16), 53),
        Category("computer_mouse", "mirror", "none", (0.095, 0.13), 53),
        Category("container", "mirror", "half turn", (0.10, 0.24), 53),
        Category("drinkbox", "mirror", "varies", (0.09, 0.24), 53),
        Category("handbag", "mirror", "half turn", (0.16, 0.32), 52),
        Category("hat", "mirror", "none", (0.24, 0.35), 52),
        Category("helmet", "mirror", "none", (0.24, 0.31), 52),
        Category("mug", "mirror", "none", (0.08, 0.14), 52),
        Category("notebook", "mirror", "varies", (0.12, 0.30), 52),
        Category("pitcher", "mirror", "none", (0.16, 0.28), 52),
        Category("pot", "mirror", "half turn", (0.18, 0.36), 52),
        Category("remote", "mirror", "none", (0.10, 0.24), 52),
        Category("steel_tape", "mirror", "none", (0.05, 0.09), 52),
        Category("teapot", "mirror", "none", (0.16, 0.27), 52),
        Category("tissue", "mirror", "varies", (0.11, 0.26), 52),
        Category("toy_airplane", "mirror", "none", (0.10, 0.28), 52),
        Category("toy_car", "mirror", "none", (0.06, 0.22), 52),
        Category("wallet", "mirror", "varies", (0.09, 0.20), 52),
        Category("brush", "functional", "half turn", (0.16, 0.30), 52),
        Category("cutter", "functional", "none", (0.13, 0.19), 52),
        Category("dustpan", "functional", "none", (0.24, 0.36), 52),
        Category("fork", "functional", "none", (0.15, 0.22), 52),
        Category("hammer", "functional", "varies", (0.25, 0.36), 52),
        Category("knife", "functional", "none", (0.18, 0.34), 52),
        Category("marker", "functional", "axis", (0.11, 0.15), 52),
        Category("pan", "functional", "none", (0.32, 0.50), 52),
        Category("pen", "functional", "none", (0.13, 0.15), 52),
        Category("pencil", "functional", "axis", (0.13, 0.20), 52),
        Category("razor", "functional", "none", (0.11, 0.16), 52),
        Category("scissor", "functional", "varies", (0.13, 0.24), 52),
        Category("screwdriver", "functional", "axis", (0.15, 0.30), 52),
        Category("spanner", "functional", "varies", (0.12, 0.30), 52),
        Category("spatula", "functional", "none", (0.25, 0.36), 52),
        Category("spoon", "functional", "none", (0.13, 0.30), 52),
        Category("squeegee", "functional", "half turn", (0.20, 0.36), 52),
        Category("toothbrush", "functional", "none", (0.15, 0.20), 52),
        Category("cabinet", "articulated", "none", (0.40, 0.90), 40),
        Category("microwave", "articulated", "none", (0.43, 0.60), 30),
        Category("oven", "articulated", "none", (0.45, 0.65), 30),
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
    folder = cached(category, index)
    if not is_built(category, index):
        _fill_cache(row, index, folder)
    return read_asset(folder)


def cached(category: str, index: int) -> Path:
    """The folder in the cache where an object is, or will be once it is built."""
    return cache_folder(category) / _category(category).instance(index)


def is_built(category: str, index: int) -> bool:
    """Whether the cache holds an object."""
    return (cached(category, index) / ASSET_FILE).is_file()


def load_by_name(name: str) -> Asset:
    """An object of the catalogue by its name, such as `"mug_003"`.

    Raises:
      InputError: There is none of this name; the nearest ones are offered.
    """
    return load(*find(name))


def find(name: str) -> tuple[str, int]:
    """Category and index of the built-in object of this name.

    Raises:
      InputError: There is none; the nearest ones are offered.
    """
    if name not in _by_name():
        raise unknown_name("built-in object", name, _by_name())
    return _by_name()[name]


def entries() -> Iterator[tuple[str, tuple[str, int]]]:
    """The name, and the category and index, of every built-in object."""
    for row in CATALOGUE.values():
        for index in range(row.instances):
            yield row.instance(index), (row.name, index)


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
        inputs={CODE: code_hash(category)},
        generator=row.module,
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
            areas=specimen.areas,
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


def cache_folder(category: str) -> Path:
    """Where a category's objects are kept: under `$MANIPOSE_CACHE`, else `~/.cache/manipose-mj`.

    One folder for each version of the code that builds them, so a change of code builds anew.

    Raises:
      InputError: There is no such category.
    """
    return cache_root() / "catalogue" / f"{category}-{code_hash(category)}"


def code_hash(category: str) -> str:
    """A hash of all the code that builds a category's objects.

    Raises:
      InputError: There is no such category.
    """
    return _code_hash(_category(category).module)


def _category(name: str) -> Category:
    if name not in CATALOGUE:
        raise unknown_name("category", name, CATALOGUE)
    return CATALOGUE[name]


def _fill_cache(row: Category, index: int, folder: Path) -> None:
    """Build aside, then move in place; whoever builds the same at the same time keeps the first."""
    try:
        with staging(folder) as scratch:
            built = build(row.name, index, scratch / folder.name)
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
def _by_name() -> dict[str, tuple[str, int]]:
    return dict(entries())


@cache
def _code_hash(module: str) -> str:
    return source_hash((__name__, module), version("mujoco"))
