"""What assets there are, built in or in a folder, without building any: rows to filter and to count."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from manipose_mj.assets import categories
from manipose_mj.assets.asset import MIN_HELD, Asset
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.assets.label import OBJECT_TYPES
from manipose_mj.errors import InputError, unknown_name

BUILT_IN = "procedural catalogue"
# How many grasps of each built-in object did, by category and index; `benchmarks/grasp_audit.py` writes it.
AUDIT_FILE = "graspability.json"


@dataclass(frozen=True)
class Entry:
    """One asset.

    Attributes:
      name: Its name.
      kind: `"rigid"` or `"articulated"`.
      category: Its category.
      type: The labelling rule.
      split: `"train"` or `"test"`; None for what is not of the catalogue.
      source: Where it came from.
      graspable: Whether enough of its grasps hold in simulation, or it has a handle; None where
        nobody has tried.
    """

    name: str
    kind: Literal["rigid", "articulated"]
    category: str
    type: str
    split: Literal["train", "test"] | None
    source: str
    graspable: bool | None


@dataclass(frozen=True)
class Filter:
    """Which assets are meant; None is no condition.

    Attributes: category; type, the labelling rule; split; source, any part of its name, in any case;
    graspable.
    """

    category: str | None = None
    type: str | None = None
    split: str | None = None
    source: str | None = None
    graspable: bool | None = None


def built_in() -> list[Entry]:
    """The catalogue's objects, by category and index."""
    rows = []
    for name, (category, index) in categories.entries():
        row = categories.CATALOGUE[category]
        articulated = row.object_type == "articulated"
        rows.append(
            Entry(
                name=name,
                kind="articulated" if articulated else "rigid",
                category=category,
                type=row.object_type,
                split=row.split(index),
                source=BUILT_IN,
                graspable=articulated or audited_grasps(category, index) >= MIN_HELD,
            )
        )
    return rows


def in_folder(directory: Path) -> list[Entry]:
    """The assets under a folder, by name.

    Raises:
      InputError: It is no folder of assets, or one of them cannot be read.
    """
    return [entry_of(read_asset(folder)) for folder in list_assets(directory)]


def entry_of(asset: Asset) -> Entry:
    """The row of a built asset."""
    split = None
    if asset.provenance.source == BUILT_IN and categories.is_known(asset.name):
        category, index = categories.find(asset.name)
        split = categories.CATALOGUE[category].split(index)
    return Entry(
        name=asset.name,
        kind=asset.kind,
        category=asset.category,
        type=asset.label.object_type,
        split=split,
        source=asset.provenance.source,
        graspable=asset.graspable,
    )


def select(entries: Iterable[Entry], criteria: Filter) -> list[Entry]:
    """Those that meet every condition.

    Raises:
      InputError: The category, type or split is none that there is.
    """
    rows = list(entries)
    _require("category", criteria.category, sorted({e.category for e in rows}))
    _require("object type", criteria.type, OBJECT_TYPES)
    _require("split", criteria.split, ("train", "test"))
    return [
        e
        for e in rows
        if criteria.category in (None, e.category)
        and criteria.type in (None, e.type)
        and criteria.split in (None, e.split)
        and (criteria.source is None or criteria.source.lower() in e.source.lower())
        and criteria.graspable in (None, e.graspable)
    ]


def statistics(entries: Iterable[Entry]) -> dict[str, Any]:
    """Counts: rigid and articulated objects, and of each category its type, instances and graspable ones."""
    rows = list(entries)
    categories: dict[str, dict[str, Any]] = {}
    for entry in rows:
        row = categories.setdefault(
            entry.category, {"type": entry.type, "instances": 0, "graspable": 0}
        )
        row["instances"] += 1
        row["graspable"] += bool(entry.graspable)
    return {
        "rigid": sum(e.kind == "rigid" for e in rows),
        "articulated": sum(e.kind == "articulated" for e in rows),
        "categories": categories,
    }


def as_json(entry: Entry) -> dict[str, Any]:
    """The row for other programs."""
    return asdict(entry)


def audited_grasps(category: str, index: int) -> int:
    """How many grasps of a built-in rigid object survived the published audit.

    Raises:
      InputError: The published file lacks the object.
    """
    try:
        return _audit()[category][index]
    except (KeyError, IndexError):
        raise InputError(
            f"{AUDIT_FILE} has no {category} with index {index}; "
            "run benchmarks/grasp_audit.py to audit the catalogue again"
        ) from None


@cache
def _audit() -> dict[str, list[int]]:
    text = files("manipose_mj.assets").joinpath(AUDIT_FILE).read_text(encoding="utf-8")
    return json.loads(text)["held"]


def _require(what: str, value: str | None, known: Iterable[str]) -> None:
    if value is not None and value not in known:
        raise unknown_name(what, value, known)
