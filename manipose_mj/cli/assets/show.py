"""`manipose assets show`: everything about one asset."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

if TYPE_CHECKING:
    from manipose_mj.assets.asset import Asset


def show_asset(
    name: Annotated[Positional[str], arg(metavar="NAME|DIR")],
    /,
    *,
    json: bool = False,
) -> None:
    """Show one asset: label, mass, stable poses, grasps, moving parts, provenance.

    Args:
      name: Of a built-in object, or the asset's folder.
      json: Print the content of its asset.json, once checked, for other programs.
    """
    from manipose_mj.assets.asset import ASSET_FILE
    from manipose_mj.assets.asset_json import read_asset
    from manipose_mj.assets.catalogue import load_by_name
    from manipose_mj.console import output

    own = "/" in name or Path(name).is_dir()
    asset = read_asset(name) if own else load_by_name(name)
    if json:
        import json as json_format

        text = (asset.folder / ASSET_FILE).read_text(encoding="utf-8")
        output.write_json(json_format.loads(text))
        return
    from rich.table import Table

    table = Table(show_header=False, title=asset.name, title_justify="left")
    for field, value in _rows(asset):
        table.add_row(field, value)
    output.standard_output().print(table)


def _rows(asset: Asset) -> list[tuple[str, str]]:
    from manipose_mj.assets.symmetry_names import symmetry_name

    label, mass, grasps = asset.label, asset.mass_properties, asset.grasps
    rows = [
        ("kind, category", f"{asset.kind}, {asset.category}"),
        ("type", label.object_type),
        ("label origin [mm]", _vector(1000 * label.origin)),
        *((f"label {axis}", _vector(label.rotation[:, i], 3)) for i, axis in enumerate("XYZ")),
        ("extents along them [mm]", _vector(1000 * label.extents)),
        ("symmetry", symmetry_name(label.symmetry)),
        ("with print", symmetry_name(label.symmetry_textured)),
        ("mass [kg]", f"{mass.mass:.3f}"),
        ("centre of mass [mm]", _vector(1000 * mass.center_of_mass)),
        ("inertia, diagonal [kg m^2]", _vector(mass.inertia.diagonal(), 7)),
    ]
    for index, pose in enumerate(asset.stable_poses):
        clear = 0 if grasps is None else int(grasps.clear[:, index].sum())
        text = f"{100 * pose.probability:.0f} %, up is {_vector(pose.rotation[2], 2)}"
        rows.append((f"stable pose {index}", f"{text}, {clear} grasps reach it"))
    if grasps is not None and len(grasps):
        low, high = 1000 * grasps.widths.min(), 1000 * grasps.widths.max()
        rows.append(("grasps", f"{len(grasps)}, {low:.0f} to {high:.0f} mm wide"))
    rows += [(f"part {part.name}", _part(part)) for part in asset.parts]
    origin = asset.provenance
    rows.append(("source", f"{origin.source}: {origin.item}"))
    rows.append(("licence", origin.licence))
    rows.append(("built by", origin.generator or "-"))
    rows += [(f"sha256 of {name}", digest) for name, digest in origin.inputs.items()]
    return rows


def _part(part: Any) -> str:
    low, high = part.joint.range
    if part.joint.kind == "slide":
        travel = f"slides {1000 * low:.0f} to {1000 * high:.0f} mm"
    else:
        travel = f"turns {math.degrees(low):.0f} to {math.degrees(high):.0f} deg"
    return travel + ("" if part.handle is None else ", has a handle")


def _vector(values: Any, digits: int = 1) -> str:
    return "  ".join(f"{v:.{digits}f}" for v in values)
