"""Objects of the catalogue as far as pictures of them need it: visuals and label, at once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from asset_pipeline.build.emit import model_element
from asset_pipeline.catalogue.instance import LICENCE, generate
from manipose_mj.assets.asset import MODEL_FILE, Asset, Provenance
from manipose_mj.assets.categories import Category


def draft(row: Category, index: int, folder: Path) -> Asset:
    """Generate an object and write its visuals into `folder`; no collision shapes, rest poses or grasps.

    Args:
      row: Of the category.
      index: Which one.
      folder: There already; gets `model.xml` and meshes, and is no asset folder.
    """
    specimen = generate(row, index)
    name = row.instance(index)
    seen = tuple(replace(body, collision=()) for body in specimen.bodies)
    ElementTree.ElementTree(model_element(name, seen, folder)).write(folder / MODEL_FILE)
    return Asset(
        folder=folder,
        name=name,
        kind="articulated" if specimen.parts else "rigid",
        category=row.name,
        label=specimen.label,
        up=np.array([0.0, 0.0, 1.0]),
        mass_properties=specimen.bodies[0].mass_properties,
        stable_poses=(),
        provenance=Provenance("procedural catalogue", name, LICENCE, generator=row.module),
        parts=specimen.parts,
        areas=specimen.areas,
    )
