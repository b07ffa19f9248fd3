"""What the built-in catalogue holds: 3,036 procedural objects in 59 categories, their names, splits and folders.

An instance is named for its category and index, `mug_003`. The same index is the same object on every
machine; index 0 of a category is its typical specimen, the others vary sizes, shape and colour. Four of
five instances of every category are for training, one is for testing, for ever the same ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Literal

from manipose_mj.assets.asset import ASSET_FILE
from manipose_mj.assets.label import ObjectType
from manipose_mj.errors import unknown_name
from manipose_mj.storage.cache_root import cache_root
from manipose_mj.storage.source_hash import source_hash

TEST_EVERY = 5  # one instance of five is a test object
_BUILDER = "asset_pipeline.catalogue.instance"

Split = Literal["train", "test"]
SPLITS: tuple[Split, ...] = ("train", "test")
# What the shape of a category maps onto itself under, proper rotations only, as the conventions have
# it; "varies" where instances differ (a square and an oblong box).
Symmetry = Literal["axis", "axis and flip", "none", "half turn", "three half turns", "varies"]


@dataclass(frozen=True)
class Category:
    """One row of the catalogue; its objects come from `generate(index)` of the pipeline's module it names.

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
    row = category_row(category)
    return tuple(row.instance(index) for index in range(row.instances))


def cached(category: str, index: int) -> Path:
    """The folder in the cache where an object is, or will be once it is built."""
    return cache_folder(category) / category_row(category).instance(index)


def is_built(category: str, index: int) -> bool:
    """Whether the cache holds an object."""
    return (cached(category, index) / ASSET_FILE).is_file()


def find(name: str) -> tuple[str, int]:
    """Category and index of the built-in object of this name.

    Raises:
      InputError: There is none; the nearest ones are offered.
    """
    if name not in _by_name():
        raise unknown_name("built-in object", name, _by_name(), listed_by="manipose list")
    return _by_name()[name]


def is_known(name: str) -> bool:
    """Whether it is a built-in object's; those that `manipose assets build --beyond` makes are none."""
    return name in _by_name()


def entries() -> Iterator[tuple[str, tuple[str, int]]]:
    """The name, and the category and index, of every built-in object."""
    for row in CATALOGUE.values():
        for index in range(row.instances):
            yield row.instance(index), (row.name, index)


def cache_folder(category: str) -> Path:
    """Where a category's objects are kept: under `$MANIPOSE_CACHE`, else `~/.cache/manipose-mj`.

    One folder for each version of the code that builds them, so a change of code rebuilds.

    Raises:
      InputError: There is no such category.
    """
    return cache_root() / "catalogue" / f"{category}-{code_hash(category)}"


def code_hash(category: str) -> str:
    """A hash of all the code that builds a category's objects.

    Raises:
      InputError: There is no such category.
    """
    return _code_hash(category_row(category).module)


def category_row(name: str) -> Category:
    """The row of a category.

    Raises:
      InputError: There is none of this name; the nearest ones are offered.
    """
    if name not in CATALOGUE:
        raise unknown_name("category", name, CATALOGUE)
    return CATALOGUE[name]


@cache
def _by_name() -> dict[str, tuple[str, int]]:
    return dict(entries())


@cache
def _code_hash(module: str) -> str:
    return source_hash((_BUILDER, module), version("mujoco"))
