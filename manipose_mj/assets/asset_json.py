"""Writing and reading what an asset folder says of its asset: `asset.json` and `grasps.json`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from manipose_mj.assets.asset import (
    ASSET_FILE,
    GRASPS_FILE,
    MODEL_FILE,
    SCHEMA_VERSION,
    Area,
    Asset,
    Cavity,
    MovingPart,
    Provenance,
    StablePose,
)
from manipose_mj.assets.geometry import Joint, MassProperties
from manipose_mj.assets.grasps_json import read_grasps, write_grasps
from manipose_mj.assets.json_fields import Fields, read_json, rounded, write_json
from manipose_mj.assets.label_json import label_to_json, quality_to_json, read_label, read_quality
from manipose_mj.errors import InputError
from manipose_mj.poses import quaternion_to_rotation, rotation_to_quaternion


def write_asset_json(asset: Asset, file: str = ASSET_FILE) -> None:
    """Write `asset.json` and, where the asset has grasps, `grasps.json` into `asset.folder`.

    Under another name, the same document without the grasps.
    """
    document: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "name": asset.name,
        "kind": asset.kind,
        "category": asset.category,
        "units": {"length": "m", "mass": "kg", "angle": "rad"},
        "up": rounded(asset.up),
        "label": label_to_json(asset.label),
        "label_quality": quality_to_json(asset.label_quality),
        "mass_properties": {
            "mass": float(asset.mass_properties.mass),
            "center_of_mass": rounded(asset.mass_properties.center_of_mass),
            "inertia": np.asarray(asset.mass_properties.inertia, float).tolist(),
        },
        "stable_poses": [
            {
                "quaternion": rounded(rotation_to_quaternion(p.rotation)),
                "height": float(p.height),
                "probability": float(p.probability),
            }
            for p in asset.stable_poses
        ],
        "parts": [_part_to_json(p) for p in asset.parts],
        "areas": [
            {"use": a.use, "center": rounded(a.center), "extents": rounded(a.extents)}
            for a in asset.areas
        ],
        "provenance": vars(asset.provenance),
    }
    write_json(asset.folder / file, document)
    if asset.grasps is not None and file == ASSET_FILE:
        write_grasps(asset.folder / GRASPS_FILE, asset.grasps)


def read_asset(folder: Path | str, file: str = ASSET_FILE) -> Asset:
    """Read and validate an asset folder, or what another file in it says of the asset, which has no grasps then.

    Raises:
      InputError: A file is missing or a field is wrong; the message names both.
    """
    folder = Path(folder)
    document = read_json(folder / file)
    if document.whole("schema_version") != SCHEMA_VERSION:
        raise document.wrong("schema_version", f"{SCHEMA_VERSION}, which this release reads")
    kind = document.text("kind", "rigid", "articulated")
    if not (folder / MODEL_FILE).is_file():
        raise InputError(f"{folder / MODEL_FILE}: missing; an asset folder needs its MJCF model")
    name = document.text("name")
    if not name or "/" in name:
        raise document.wrong("name", "a name without /")
    stable = tuple(_stable_pose(fields) for fields in document.each("stable_poses"))
    grasps = folder / GRASPS_FILE if file == ASSET_FILE else None
    if not stable and grasps is not None and grasps.is_file():
        raise document.wrong("stable_poses", f"the poses that {GRASPS_FILE} speaks of")
    provenance = document.fields("provenance")
    return Asset(
        folder=folder,
        name=name,
        kind=kind,
        category=document.text("category"),
        label=read_label(document.fields("label")),
        up=document.unit("up", 3),
        mass_properties=_mass_properties(document.fields("mass_properties")),
        stable_poses=stable,
        provenance=Provenance(
            source=provenance.text("source"),
            item=provenance.text("item"),
            licence=provenance.text("licence"),
            inputs=provenance.fields("inputs").values,
            generator=provenance.text("generator"),
        ),
        parts=tuple(_part(fields) for fields in document.each("parts")),
        areas=tuple(_area(fields) for fields in document.each("areas")),
        grasps=None if grasps is None else read_grasps(grasps, len(stable)),
        label_quality=read_quality(document.optional("label_quality")),
    )


def list_assets(directory: Path | str) -> list[Path]:
    """The asset folders directly under `directory`, sorted by name.

    Raises:
      InputError: The directory does not exist, is a file or holds no asset.
    """
    directory = Path(directory)
    if directory.is_file():
        raise InputError(f"{directory}: is a file; expected a folder of an asset or of assets")
    if not directory.is_dir():
        raise InputError(f"{directory}: no such folder; expected a folder of built assets")
    folders = sorted(p.parent for p in directory.glob(f"*/{ASSET_FILE}"))
    if not folders:
        raise InputError(f"{directory}: holds no asset folder (none with an {ASSET_FILE})")
    return folders


def _mass_properties(fields: Fields) -> MassProperties:
    inertia = fields.array("inertia", 3, 3)
    if np.linalg.eigvalsh(inertia).min() <= 0:
        raise fields.wrong("inertia", "a positive definite matrix")
    return MassProperties(fields.positive("mass"), fields.array("center_of_mass", 3), inertia)


def _stable_pose(fields: Fields) -> StablePose:
    return StablePose(
        rotation=quaternion_to_rotation(fields.unit("quaternion", 4)),
        height=fields.number("height"),
        probability=fields.number("probability"),
    )


def _part_to_json(part: MovingPart) -> dict[str, Any]:
    joint, cavity = part.joint, part.cavity
    return {
        "name": part.name,
        "joint": {
            "type": joint.kind,
            "origin": rounded(joint.origin),
            "axis": rounded(joint.axis),
            "range": rounded(joint.range),
            "frictionloss": float(joint.frictionloss),
            "damping": float(joint.damping),
        },
        "handle": None if part.handle is None else label_to_json(part.handle),
        "cavity": None
        if cavity is None
        else {
            "center": rounded(cavity.center),
            "extents": rounded(cavity.extents),
            "moves_with_part": cavity.moves_with_part,
        },
    }


def _part(fields: Fields) -> MovingPart:
    joint = fields.fields("joint")
    low, high = joint.array("range", 2)
    if low >= high:
        raise joint.wrong("range", "the lower limit first, below the upper one")
    handle, cavity = fields.optional("handle"), fields.optional("cavity")
    return MovingPart(
        name=fields.text("name"),
        joint=Joint(
            kind=joint.text("type", "slide", "hinge"),
            origin=joint.array("origin", 3),
            axis=joint.unit("axis", 3),
            range=(float(low), float(high)),
            frictionloss=joint.number("frictionloss"),
            damping=joint.number("damping"),
        ),
        handle=None if handle is None else read_label(handle),
        cavity=None
        if cavity is None
        else Cavity(
            center=cavity.array("center", 3),
            extents=cavity.array("extents", 3),
            moves_with_part=cavity.flag("moves_with_part"),
        ),
    )


def _area(fields: Fields) -> Area:
    return Area(
        use=fields.text("use", "grip", "functional"),
        center=fields.array("center", 3),
        extents=fields.array("extents", 3),
    )
