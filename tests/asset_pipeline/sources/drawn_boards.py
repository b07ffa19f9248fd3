"""Boxes as the visuals of a link, in PartNet-Mobility's layout."""

from __future__ import annotations

from pathlib import Path

import trimesh

# Of each its part's name, lowest and highest corner.
Boards = list[tuple[str, tuple[float, float, float], tuple[float, float, float]]]


def board_visuals(folder: Path, link: str, boards: Boards) -> str:
    """Write the meshes into `folder`, and return the `<visual>` elements of the URDF's link."""
    (folder / "textured_objs").mkdir(parents=True, exist_ok=True)
    visuals = ""
    for count, (name, low, high) in enumerate(boards):
        file = f"textured_objs/{link}_{count}.obj"
        trimesh.creation.box(bounds=[low, high]).export(folder / file)
        visuals += f'<visual name="{name}"><geometry><mesh filename="{file}"/></geometry></visual>'
    return visuals
