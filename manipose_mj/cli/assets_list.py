"""`manipose assets list`: what is in a folder of assets, or built in."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from manipose_mj.cli.process import CORES

if TYPE_CHECKING:
    from asset_pipeline.assets import Asset


def list_objects(
    directory: Annotated[
        Positional[Path | None], arg(metavar="[DIR]", help_behavior_hint="")
    ] = None,
    /,
    *,
    json: bool = False,
) -> None:
    """List assets with their category, type, mass, stable poses and grasps.

    Args:
      directory: Folder of assets; without it the built-in objects, which the first time takes a minute.
      json: Print JSON, for other programs.
    """
    from asset_pipeline.asset_json import list_assets, read_asset
    from manipose_mj.cli import output
    from manipose_mj.cli.builtin_objects import all_names, load_objects

    if directory is None:
        assets = load_objects(all_names(), CORES)
    else:
        assets = [read_asset(folder) for folder in list_assets(directory)]
    rows = [summary(asset) for asset in assets]
    if json:
        output.write_json(rows)
        return
    from rich.table import Table

    table = Table("name", "category", "type", "kg", "stable poses", "grasps", "graspable")
    for column in table.columns[3:6]:
        column.justify = "right"
    for row in rows:
        table.add_row(
            row["name"],
            row["category"],
            row["type"],
            f"{row['mass_kg']:.3f}",
            str(row["stable_poses"]),
            str(row["grasps"]),
            "yes" if row["graspable"] else "no",
        )
    output.standard_output().print(table)


def summary(asset: Asset) -> dict[str, Any]:
    """One asset in a line.

    `graspable`: the hand can close on it while it lies in one of its stable poses, or on a handle.
    """
    grasps = asset.grasps
    lying = grasps is not None and bool(grasps.clear.any())
    return {
        "name": asset.name,
        "category": asset.category,
        "type": asset.label.object_type,
        "mass_kg": asset.mass_properties.mass,
        "stable_poses": len(asset.stable_poses),
        "grasps": 0 if grasps is None else len(grasps),
        "graspable": lying or any(part.handle is not None for part in asset.parts),
        "folder": str(asset.folder),
    }
