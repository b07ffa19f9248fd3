"""The asset folder: the contract between the pipeline that writes it and the packages that read it.

A folder holds `asset.json`, `model.xml` (loads alone), `meshes/` and, for rigid objects, `grasps.json`.
SI units; every vector in the object frame, which is the mesh frame and the model's body frame.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry import Joint, MassProperties
from asset_pipeline.labelling.label import (
    OBJECT_TYPES,
    PoseLabel,
    symmetry_from_bop,
    symmetry_to_bop,
)
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, quaternion_to_rotation, rotation_to_quaternion

SCHEMA_VERSION = 1
ASSET_FILE = "asset.json"
MODEL_FILE = "model.xml"
GRASPS_FILE = "grasps.json"


@dataclass(frozen=True)
class StablePose:
    """A way to rest on a horizontal plane.

    Attributes:
      rotation: `R_world_object`, up to the free turn about the vertical.
      height: Of the object frame's origin above the plane [m].
      probability: Share of drops that end in it.
    """

    rotation: Float[np.ndarray, "3 3"]
    height: float
    probability: float

    @property
    def pose(self) -> Float[np.ndarray, "4 4"]:
        """`T_world_object` above the world's origin."""
        return compose(self.rotation, np.array([0.0, 0.0, self.height]))


@dataclass(frozen=True)
class GraspSet:
    """Parallel-jaw grasps in the object frame.

    Attributes:
      poses: `(n, 4, 4)`, `T_object_tcp`: z is the approach, y the closing direction, the origin
        midway between the finger pads.
      widths: `(n,)` [m], between the pads when they touch.
      clear: `(n, s)`, whether the open gripper stays clear of the plane in stable pose `s`.
    """

    poses: Float[np.ndarray, "n 4 4"]
    widths: Float[np.ndarray, "n"]
    clear: np.ndarray

    def __len__(self) -> int:
        return len(self.poses)


@dataclass(frozen=True)
class Cavity:
    """Free space that a part encloses: an upright box in the object frame, joints at zero.

    Attributes: center `(3,)` [m]; extents `(3,)` [m], full lengths along the object axes;
    moves_with_part: True for a drawer, False for the space behind a door.
    """

    center: Float[np.ndarray, "3"]
    extents: Float[np.ndarray, "3"]
    moves_with_part: bool


@dataclass(frozen=True)
class MovingPart:
    """A drawer or a door: its body's name, joint, handle label and the cavity it opens."""

    name: str
    joint: Joint
    handle: PoseLabel | None
    cavity: Cavity | None


@dataclass(frozen=True)
class Provenance:
    """Where an asset came from: source, item, licence, sha256 of every input file, generator."""

    source: str
    item: str
    licence: str
    inputs: dict[str, str] = field(default_factory=dict)
    generator: str = ""


@dataclass(frozen=True)
class Asset:
    """A built asset, as read from its folder. Fields as in `asset.json`."""

    folder: Path
    name: str
    kind: Literal["rigid", "articulated"]
    category: str
    label: PoseLabel
    up: Float[np.ndarray, "3"]
    mass_properties: MassProperties
    stable_poses: tuple[StablePose, ...]
    provenance: Provenance
    parts: tuple[MovingPart, ...] = ()
    grasps: GraspSet | None = None

    @property
    def model_path(self) -> Path:
        """The MJCF file."""
        return self.folder / MODEL_FILE

    def part(self, name: str) -> MovingPart:
        """The moving part of this name.

        Raises:
          InputError: There is none.
        """
        for part in self.parts:
            if part.name == name:
                return part
        known = ", ".join(p.name for p in self.parts) or "none"
        raise InputError(f"{self.folder}: no moving part {name!r}; parts: {known}")


def write_asset_json(asset: Asset) -> None:
    """Write `asset.json` and, where the asset has grasps, `grasps.json` into `asset.folder`."""
    document: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "name": asset.name,
        "kind": asset.kind,
        "category": asset.category,
        "units": {"length": "m", "mass": "kg", "angle": "rad"},
        "up": _floats(asset.up),
        "label": _label_to_json(asset.label),
        "mass_properties": {
            "mass": float(asset.mass_properties.mass),
            "center_of_mass": _floats(asset.mass_properties.center_of_mass),
            "inertia": np.asarray(asset.mass_properties.inertia, float).tolist(),
        },
        "stable_poses": [
            {
                "quaternion": _floats(rotation_to_quaternion(p.rotation)),
                "height": float(p.height),
                "probability": float(p.probability),
            }
            for p in asset.stable_poses
        ],
        "parts": [_part_to_json(p) for p in asset.parts],
        "provenance": vars(asset.provenance),
    }
    _write_json(asset.folder / ASSET_FILE, document)
    if asset.grasps is not None:
        grasps = {
            "poses": _floats(asset.grasps.poses[:, :3, :4].reshape(-1, 12)),
            "widths": _floats(asset.grasps.widths),
            "clear": asset.grasps.clear.astype(int).tolist(),
        }
        _write_json(asset.folder / GRASPS_FILE, grasps)


def read_asset(folder: Path | str) -> Asset:
    """Read and validate an asset folder.

    Raises:
      InputError: A file is missing or a field is wrong; the message names both.
    """
    folder = Path(folder)
    path = folder / ASSET_FILE
    document = _read_json(path)
    version = _field(path, document, "schema_version", int)
    if version != SCHEMA_VERSION:
        raise InputError(
            f"{path}: field 'schema_version' is {version}; this release reads {SCHEMA_VERSION}"
        )
    kind = _field(path, document, "kind", str)
    if kind not in ("rigid", "articulated"):
        raise InputError(f"{path}: field 'kind' is {kind!r}; expected 'rigid' or 'articulated'")
    if not (folder / MODEL_FILE).is_file():
        raise InputError(f"{folder / MODEL_FILE}: missing; an asset folder needs its MJCF model")
    mass = _field(path, document, "mass_properties", dict)
    properties = MassProperties(
        mass=_positive(path, mass, "mass", "mass_properties.mass"),
        center_of_mass=_array(path, mass, "center_of_mass", (3,), "mass_properties.center_of_mass"),
        inertia=_array(path, mass, "inertia", (3, 3), "mass_properties.inertia"),
    )
    if np.linalg.eigvalsh(properties.inertia).min() <= 0:
        raise InputError(f"{path}: field 'mass_properties.inertia' is not positive definite")
    stable = tuple(
        _stable_pose(path, entry, i)
        for i, entry in enumerate(_field(path, document, "stable_poses", list))
    )
    parts = tuple(
        _part(path, entry, i) for i, entry in enumerate(_field(path, document, "parts", list))
    )
    provenance = _field(path, document, "provenance", dict)
    return Asset(
        folder=folder,
        name=_field(path, document, "name", str),
        kind=kind,  # pyright: ignore[reportArgumentType]
        category=_field(path, document, "category", str),
        label=_label(path, _field(path, document, "label", dict), "label"),
        up=_array(path, document, "up", (3,), "up"),
        mass_properties=properties,
        stable_poses=stable,
        provenance=Provenance(
            source=_field(path, provenance, "source", str, "provenance.source"),
            item=_field(path, provenance, "item", str, "provenance.item"),
            licence=_field(path, provenance, "licence", str, "provenance.licence"),
            inputs=_field(path, provenance, "inputs", dict, "provenance.inputs"),
            generator=_field(path, provenance, "generator", str, "provenance.generator"),
        ),
        parts=parts,
        grasps=_read_grasps(folder / GRASPS_FILE, len(stable)),
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


def _floats(values: Any) -> Any:
    return np.round(np.asarray(values, float), 9).tolist()


def _write_json(path: Path, document: dict[str, Any]) -> None:
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _read_json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: missing; expected an asset folder") from None
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: not valid JSON ({error})") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: holds a {type(document).__name__}; expected a JSON object")
    return document


def _field(
    path: Path, document: dict[str, Any], key: str, kind: type, name: str | None = None
) -> Any:
    name = name or key
    if key not in document:
        raise InputError(f"{path}: field {name!r} is missing; expected a {kind.__name__}")
    value = document[key]
    if not isinstance(value, kind) or isinstance(value, bool):
        raise InputError(
            f"{path}: field {name!r} is a {type(value).__name__}; expected a {kind.__name__}"
        )
    return value


def _positive(path: Path, document: dict[str, Any], key: str, name: str) -> float:
    value = _number(path, document, key, name)
    if value <= 0:
        raise InputError(f"{path}: field {name!r} is {value}; expected a positive number")
    return value


def _number(path: Path, document: dict[str, Any], key: str, name: str) -> float:
    value = document.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(f"{path}: field {name!r} is {value!r}; expected a finite number")
    return float(value)


def _array(
    path: Path, document: dict[str, Any], key: str, shape: tuple[int, ...], name: str
) -> np.ndarray:
    try:
        value = np.asarray(document.get(key), dtype=float)
    except (TypeError, ValueError):
        value = np.empty(0)
    if value.shape != shape or not np.isfinite(value).all():
        size = " x ".join(map(str, shape))
        raise InputError(f"{path}: field {name!r} is not {size} finite numbers")
    return value


def _unit_quaternion(path: Path, document: dict[str, Any], name: str) -> np.ndarray:
    value = _array(path, document, "quaternion", (4,), name)
    if abs(np.linalg.norm(value) - 1) > 1e-3:
        raise InputError(f"{path}: field {name!r} is not a unit wxyz quaternion")
    return value


def _label_to_json(label: PoseLabel) -> dict[str, Any]:
    return {
        "object_type": label.object_type,
        "origin": _floats(label.origin),
        "rotation": _floats(label.rotation),
        "extents": _floats(label.extents),
        **symmetry_to_bop(label),
    }


def _label(path: Path, document: dict[str, Any], name: str) -> PoseLabel:
    object_type = _field(path, document, "object_type", str, f"{name}.object_type")
    if object_type not in OBJECT_TYPES:
        raise InputError(
            f"{path}: field '{name}.object_type' is {object_type!r}; "
            f"expected one of {', '.join(OBJECT_TYPES)}"
        )
    rotation = _array(path, document, "rotation", (3, 3), f"{name}.rotation")
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
        raise InputError(f"{path}: field '{name}.rotation' is not a right-handed rotation matrix")
    discrete = _field(path, document, "symmetries_discrete", list, f"{name}.symmetries_discrete")
    continuous = _field(
        path, document, "symmetries_continuous", list, f"{name}.symmetries_continuous"
    )
    try:
        symmetry = symmetry_from_bop(rotation, discrete, continuous)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: field '{name}.symmetries_*' is wrong: {error}") from None
    extents = _array(path, document, "extents", (3,), f"{name}.extents")
    if (extents <= 0).any():
        raise InputError(f"{path}: field '{name}.extents' is not 3 positive lengths")
    return PoseLabel(
        origin=_array(path, document, "origin", (3,), f"{name}.origin"),
        rotation=rotation,
        object_type=object_type,  # pyright: ignore[reportArgumentType]
        extents=extents,
        symmetry=symmetry,
    )


def _stable_pose(path: Path, document: Any, index: int) -> StablePose:
    name = f"stable_poses[{index}]"
    if not isinstance(document, dict):
        raise InputError(f"{path}: field {name!r} is not an object")
    quaternion = _unit_quaternion(path, document, f"{name}.quaternion")
    return StablePose(
        rotation=quaternion_to_rotation(quaternion),
        height=_number(path, document, "height", f"{name}.height"),
        probability=_number(path, document, "probability", f"{name}.probability"),
    )


def _part_to_json(part: MovingPart) -> dict[str, Any]:
    joint, cavity = part.joint, part.cavity
    return {
        "name": part.name,
        "joint": {
            "type": joint.kind,
            "origin": _floats(joint.origin),
            "axis": _floats(joint.axis),
            "range": _floats(joint.range),
            "frictionloss": float(joint.frictionloss),
            "damping": float(joint.damping),
        },
        "handle": None if part.handle is None else _label_to_json(part.handle),
        "cavity": None
        if cavity is None
        else {
            "center": _floats(cavity.center),
            "extents": _floats(cavity.extents),
            "moves_with_part": cavity.moves_with_part,
        },
    }


def _part(path: Path, document: Any, index: int) -> MovingPart:
    name = f"parts[{index}]"
    if not isinstance(document, dict):
        raise InputError(f"{path}: field {name!r} is not an object")
    joint = _field(path, document, "joint", dict, f"{name}.joint")
    kind = _field(path, joint, "type", str, f"{name}.joint.type")
    if kind not in ("slide", "hinge"):
        raise InputError(f"{path}: field '{name}.joint.type' is {kind!r}; expected slide or hinge")
    low, high = _array(path, joint, "range", (2,), f"{name}.joint.range")
    axis = _array(path, joint, "axis", (3,), f"{name}.joint.axis")
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
        name=_field(path, document, "name", str, f"{name}.name"),
        joint=Joint(
            kind=kind,  # pyright: ignore[reportArgumentType]
            origin=_array(path, joint, "origin", (3,), f"{name}.joint.origin"),
            axis=axis,
            range=(float(low), float(high)),
            frictionloss=_number(path, joint, "frictionloss", f"{name}.joint.frictionloss"),
            damping=_number(path, joint, "damping", f"{name}.joint.damping"),
        ),
        handle=None if handle is None else _label(path, handle, f"{name}.handle"),
        cavity=None
        if cavity is None
        else Cavity(
            center=_array(path, cavity, "center", (3,), f"{name}.cavity.center"),
            extents=_array(path, cavity, "extents", (3,), f"{name}.cavity.extents"),
            moves_with_part=bool(cavity.get("moves_with_part")),
        ),
    )


def _read_grasps(path: Path, stable_poses: int) -> GraspSet | None:
    if not path.is_file():
        return None
    document = _read_json(path)
    count = len(_field(path, document, "widths", list))
    widths = _array(path, document, "widths", (count,), "widths")
    rows = _array(path, document, "poses", (count, 12), "poses") if count else np.empty((0, 12))
    clear = _array(path, document, "clear", (count, stable_poses), "clear") if count else None
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :] = rows.reshape(-1, 3, 4)
    return GraspSet(
        poses=poses,
        widths=widths,
        clear=np.empty((0, stable_poses), bool) if clear is None else clear.astype(bool),
    )
