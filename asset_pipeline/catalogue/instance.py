"""Make the objects of the built-in catalogue: generate a specimen and write its asset folder."""

from __future__ import annotations

import importlib
import logging
from pathlib import Path

import numpy as np

from asset_pipeline.build.emit import write_asset
from asset_pipeline.build.rigid import finish_rigid
from asset_pipeline.procedural.specimen import Specimen
from manipose_mj.assets.asset import Asset, Provenance
from manipose_mj.assets.categories import Category, category_row, code_hash

log = logging.getLogger(__name__)

LICENCE = "Apache-2.0"
CODE = "code"  # in an object's provenance: the hash of what built it


def generate(row: Category, index: int) -> Specimen:
    """The object of this index, from the generator of its category."""
    return importlib.import_module(row.module).generate(index)


def build(category: str, index: int, folder: Path) -> Asset:
    """Generate an object and write its asset folder.

    Args:
      category: One of `names()`.
      index: Which one; any natural number, also beyond the built-in instances.
      folder: Where to write; replaced whole if it is there.
    """
    row = category_row(category)
    name = row.instance(index)
    log.info("building %s into %s", name, folder)
    specimen = generate(row, index)
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
