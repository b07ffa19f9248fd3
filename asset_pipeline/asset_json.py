"""Writing and reading what an asset folder says of its asset: `asset.json` and `grasps.json`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from asset_pipeline.assets import (
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
from asset_pipeline.geometry import Joint, MassProperties
from asset_pipeline.grasps_json import read_grasps, write_grasps
from asset_pipeline.json_fields import (
    array,
    number,
    positive,
    read_json,
    rounded,
    typed,
    unit_quaternion,
    write_json,
)
from asset_pipeline.label_json import label_to_json, quality_to_json, read_label, read_quality
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
    """Read and validate an asset folder, or what another file in it says of the asset.

    Raises:
      InputError: A file is missing or a field is wrong; the message names both.
    """
    folder = Path(folder)
    path = folder / file
    document = read_json(path)
    version = typed(path, document, "schema_version", int)
    if version != SCHEMA_VERSION:
        raise InputError(
            f"{path}: field 'schema_version' is {version}; this release reads {SCHEMA_VERSION}"
        )
    kind = typed(path, document, "kind", str)
    if kind not in ("rigid", "articulated"):
        raise InputError(f"{path}: field 'kind' is {kind!r}; expected 'rigid' or 'articulated'")
    if not (folder / MODEL_FILE).is_file():
        raise InputError(f"{folder / MODEL_FILE}: missing; an asset folder needs its MJCF model")
    mass = typed(path, document, "mass_properties", dict)
    properties = MassProperties(
        mass=positive(path, mass, "mass", "mass_properties.mass"),
        center_of_mass=array(path, mass, "center_of_mass", (3,), "mass_properties.center_of_mass"),
        inertia=array(path, mass, "inertia", (3, 3), "mass_properties.inertia"),
    )
    if np.linalg.eigvalsh(properties.inertia).min() <= 0:
        raise InputError(f"{path}: field 'mass_properties.inertia' is not positive definite")
    stable = tuple(
        _stable_pose(path, entry, i)
        for i, entry in enumerate(typed(path, document, "stable_poses", list))
    )
    parts = tuple(
        _part(path, entry, i) for i, entry in enumerate(typed(path, document, "parts", list))
    )
    provenance = typed(path, document, "provenance", dict)
    return Asset(
        folder=folder,
        name=typed(path, document, "name", str),
        kind=kind,  # pyright: ignore[reportArgumentType]
        category=typed(path, document, "category", str),
        label=read_label(path, typed(path, document, "label", dict), "label"),
        up=array(path, document, "up", (3,), "up"),
        mass_properties=properties,
        stable_poses=stable,
        provenance=Provenance(
            source=typed(path, provenance, "source", str, "provenance.source"),
            item=typed(path, provenance, "item", str, "provenance.item"),
            licence=typed(path, provenance, "licence", str, "provenance.licence"),
            inputs=typed(path, provenance, "inputs", dict, "provenance.inputs"),
            generator=typed(path, provenance, "generator", str, "provenance.generator"),
        ),
        parts=parts,
        areas=tuple(
            _area(path, entry, i) for i, entry in enumerate(typed(path, document, "areas", list))
        ),
        grasps=read_grasps(folder / GRASPS_FILE, len(stable)),
        label_quality=read_quality(path, document.get("label_quality")),
    )


def list_assets(directory: Path | str) -> list[Path]:
    """The asset folders directly under `directory`, sorted by name.

    Raises:
      InputError: The directory does not exist or holds no asset.
    """
    directory = Path(directory)
    if not directory.is_dir():
        raise InputError(f"{directory}: no such folder; expected a folder of built assets")
    folders = sorted(p.parent for p in directory.glob(f"*/{ASSET_FILE}"))
    if not folders:
        raise InputError(f"{directory}: holds no asset folder (none with an {ASSET_FILE})")
    return folders


def _stable_pose(path: Path, document: Any, index: int) -> StablePose:
    name = f"stable_poses[{index}]"
    if not isinstance(document, dict):
        raise InputError(f"{path}: field {name!r} is not an object")
    quaternion = unit_quaternion(path, document, f"{name}.quaternion")
    return StablePose(
        rotation=quaternion_to_rotation(quaternion),
        height=number(path, document, "height", f"{name}.height"),
        probability=number(path, document, "probability", f"{name}.probability"),
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


def _part(path: Path, document: Any, index: int) -> MovingPart:
    name = f"parts[{index}]"
    if not isinstance(document, dict):
        raise InputError(f"{path}: field {name!r} is not an object")
    joint = typed(path, document, "joint", dict, f"{name}.joint")
    kind = typed(path, joint, "type", str, f"{name}.joint.type")
    if kind not in ("slide", "hinge"):
        raise InputError(f"{path}: field '{name}.joint.type' is {kind!r}; expected slide or hinge")
    low, high = array(path, joint, "range", (2,), f"{name}.joint.range")
    axis = array(path, joint, "axis", (3,), f"{name}.joint.axis")
    if low >= high:
        raise InputError(f"{path}: field '{name}.joint.range' is empty; expected low < high")
    if abs(np.linalg.norm(axis) - 1) > 1e-3:
        raise InputError(f"{path}: field '{name}.joint.axis' is not a unit vector")
    handle, cavity = document.get("handle"), document.get("cavity")
    for key, value in (("handle", handle), ("cavity", cavity)):
        if value is not None and not isinstance(value, dict):
            raise InputError(
                f"{path}: field '{name}.{key}' is {value!r}; expected an object or null"
            )
    return MovingPart(
        name=typed(path, document, "name", str, f"{name}.name"),
        joint=Joint(
            kind=kind,  # pyright: ignore[reportArgumentType]
            origin=array(path, joint, "origin", (3,), f"{name}.joint.origin"),
            axis=axis,
            range=(float(low), float(high)),
            frictionloss=number(path, joint, "frictionloss", f"{name}.joint.frictionloss"),
            damping=number(path, joint, "damping", f"{name}.joint.damping"),
        ),
        handle=None if handle is None else read_label(path, handle, f"{name}.handle"),
        cavity=None
        if cavity is None
        else Cavity(
            center=array(path, cavity, "center", (3,), f"{name}.cavity.center"),
            extents=array(path, cavity, "extents", (3,), f"{name}.cavity.extents"),
            moves_with_part=bool(cavity.get("moves_with_part")),
        ),
    )


def _area(path: Path, document: Any, index: int) -> Area:
    name = f"areas[{index}]"
    if not isinstance(document, dict):
        raise InputError(f"{path}: field {name!r} is not an object")
    use = typed(path, document, "use", str, f"{name}.use")
    if use not in ("grip", "functional"):
        raise InputError(f"{path}: field '{name}.use' is {use!r}; expected grip or functional")
    return Area(
        use=use,  # pyright: ignore[reportArgumentType]
        center=array(path, document, "center", (3,), f"{name}.center"),
        extents=array(path, document, "extents", (3,), f"{name}.extents"),
    )
