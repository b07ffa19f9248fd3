"""Objects of the catalogue in folders, as built assets are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from asset_pipeline.build import emit
from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset, Provenance
from manipose_mj.poses import SymmetryGroup


def write_asset(
    directory: Path, name: str, category: str, symmetry: SymmetryGroup | None = None
) -> None:
    """Write the first object of a category, with this symmetry instead of its own, under another name."""
    specimen = catalogue.generate(category, 0)
    label = specimen.label if symmetry is None else replace(specimen.label, symmetry=symmetry)
    asset = Asset(
        folder=directory / name,
        name=name,
        kind="rigid",
        category=category,
        label=label,
        up=np.array([0.0, 0.0, 1.0]),
        mass_properties=specimen.bodies[0].mass_properties,
        stable_poses=(),
        provenance=Provenance(source="test", item=category, licence="Apache-2.0", inputs={}),
    )
    emit.write_asset(asset, specimen.bodies)
