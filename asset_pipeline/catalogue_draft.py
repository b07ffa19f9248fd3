"""Objects of the catalogue as far as pictures of them need it: looks and label, in a moment."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from asset_pipeline.assets import MODEL_FILE, Asset, Provenance
from asset_pipeline.catalogue import CATALOGUE, LICENCE
from asset_pipeline.emit import model_element


def draft(category: str, index: int, folder: Path) -> Asset:
    """Generate an object and write its looks into `folder`; no collision shapes, rest poses or grasps.

    Args:
      category: One of `catalogue.names()`.
      index: Which one.
      folder: There already; gets `model.xml` and meshes, and is no asset folder.
    """
    row = CATALOGUE[category]
    specimen = row.generate(index)
    name = row.instance(index)
    seen = tuple(replace(body, collision=()) for body in specimen.bodies)
    ElementTree.ElementTree(model_element(name, seen, folder)).write(folder / MODEL_FILE)
    return Asset(
        folder=folder,
        name=name,
        kind="articulated" if specimen.parts else "rigid",
        category=category,
        label=specimen.label,
        up=np.array([0.0, 0.0, 1.0]),
        mass_properties=specimen.bodies[0].mass_properties,
        stable_poses=(),
        provenance=Provenance("procedural catalogue", name, LICENCE, generator=row.module),
        parts=specimen.parts,
        areas=specimen.areas,
    )
