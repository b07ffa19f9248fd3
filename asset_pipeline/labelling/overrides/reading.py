"""A person's word on labels: `labels.yaml`, which overrides what was measured, object by object.

The file maps names of objects to entries; every key of an entry is optional, and what is not named stays
as it was measured. Lengths in metres, vectors in the mesh frame (the frame of the asset's meshes).

    065-a_cups:
      origin: [0.012, 0.003, 0.031]     # the label's origin
      x: [0, 0, 1]                      # the label's X and Y; Y is made square to X
      y: [1, 0, 0]
      symmetry: axis                    # of the shape; a key of SYMMETRIES

    035_power_drill:
      object_type: functional           # measured again as this type: axial, mirror or functional
      functional: [0, 1, 0]             # roughly from grip to functional end
      category: drill
      mass: 0.895                       # [kg]
      adjust:                           # last, on top of all else
        turn: [0, 0, 2.5]               # [deg] about the label's own X, then Y, then Z
        shift: [0.004, 0, 0]            # [m] along the label's X, Y, Z before the turn

    "7167":                             # a name in digits, in quotes
      parts:
        door_0:                         # a moving part, by the name of its body; `manipose assets show` prints them
          handle: {origin: [-0.195, -0.12, 0.15], x: [0, 0, 1], y: [-1, 0, 0]}
          joint: {origin: [-0.138, 0.228, 0], axis: [0, 0, -1]}   # positive is opening

A handle that was not found has `extents` as well: its lengths along X, Y, Z [m]. Beside these: `rotation`, three rows of three numbers whose columns are the label's X, Y, Z, instead of `x`
and `y`; and `up`, the object's upright direction, from which the label is measured again.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from jaxtyping import Float

from asset_pipeline.labelling.overrides.fields import (
    direction,
    kind_of,
    mapping,
    numbers,
    require_known,
    rotation_of,
)
from asset_pipeline.sources.categories import kind_of as category_of
from manipose_mj.assets.label import OBJECT_TYPES, ObjectType
from manipose_mj.assets.symmetry_names import SYMMETRIES
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.poses import SymmetryGroup

LABELS_FILE = "labels.yaml"
SCAN_TYPES = ("axial", "mirror", "functional")
FRAME_KEYS = ("origin", "x", "y", "rotation", "symmetry", "adjust")
HANDLE_KEYS = (*FRAME_KEYS, "extents")
ENTRY_KEYS = (*FRAME_KEYS, "object_type", "up", "functional", "category", "mass", "parts")


@dataclass(frozen=True)
class FrameOverride:
    """What a person says of a label frame.

    Attributes:
      origin: `(3,)` [m], in the mesh frame.
      rotation: `(3, 3)`, columns X, Y, Z in the mesh frame.
      symmetry: Of the shape.
      turn: `(3,)` [rad] about the label's own X, then Y, then Z, after all else.
      shift: `(3,)` [m] along its X, Y, Z before that turn.
      extents: `(3,)` [m], lengths along its X, Y, Z; of handles only, an object's are measured.
    """

    origin: Float[np.ndarray, "3"] | None = None
    rotation: Float[np.ndarray, "3 3"] | None = None
    symmetry: SymmetryGroup | None = None
    turn: Float[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))
    shift: Float[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))
    extents: Float[np.ndarray, "3"] | None = None

    @property
    def whole(self) -> bool:
        """Whether nothing of the frame is left to be measured."""
        return not (self.origin is None or self.rotation is None or self.symmetry is None)


@dataclass(frozen=True)
class PartOverride:
    """What a person says of a moving part: its handle, and a point on its axis [m] and the axis, unit."""

    handle: FrameOverride | None = None
    joint_origin: Float[np.ndarray, "3"] | None = None
    joint_axis: Float[np.ndarray, "3"] | None = None


@dataclass(frozen=True)
class Override:
    """What a person says of one object.

    Attributes:
      frame: Its label.
      object_type: Which labelling rule applies.
      up: `(3,)`, unit, in the mesh frame.
      functional: `(3,)`, unit, roughly from grip to functional end.
      category: What kind of object it is.
      mass: [kg].
      parts: By the names of moving parts.
      where: File and object, which open messages.
      digest: Twelve hexadecimal digits that change with the entry.
    """

    frame: FrameOverride
    object_type: ObjectType | None
    up: Float[np.ndarray, "3"] | None
    functional: Float[np.ndarray, "3"] | None
    category: str | None
    mass: float | None
    parts: dict[str, PartOverride]
    where: str
    digest: str


def read_overrides(path: Path) -> dict[str, Override]:
    """The entries of a labels file by object.

    Raises:
      InputError: The file is missing or not YAML, or an entry is wrong; one line names file, object,
        field and what would be right.
    """
    return {name: parsed(path, name, entry) for name, entry in read_entries(path).items()}


def read_entries(path: Path) -> dict[str, dict[str, Any]]:
    """The entries as plain data, unchecked but for being mappings of known objects.

    Raises:
      InputError: The file is missing, not YAML, or not a mapping of mappings; or a key stands twice, or a value
        holds itself.
    """
    try:
        text = path.read_text(encoding="utf-8")
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        document = yaml.safe_load(text)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; expected a YAML file of labels") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text ({error.reason})") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = "" if mark is None else f":{mark.line + 1}"
        reason = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise InputError(f"{path}{line}: not valid YAML ({reason})") from None
    if document is None:
        return {}
    if not isinstance(document, dict):
        raise InputError(f"{path}: holds {kind_of(document)}; expected objects' names with entries")
    _check_nodes(root, path, "an entry")
    for name, entry in document.items():
        if not isinstance(name, str):
            raise InputError(f'{path}: object {name!r} is no text; write the name in quotes: "..."')
        if not isinstance(entry, dict):
            raise InputError(
                f"{path}: {name}: is {kind_of(entry)}; expected fields such as 'origin'"
            )
    return document


def _check_nodes(
    node: yaml.Node, path: Path, what: str, inside: tuple[yaml.Node, ...] = ()
) -> None:
    """Check what YAML lets pass.

    Raises:
      InputError: A key stands twice, of which YAML would take the last; or a value holds itself, by its alias.
    """
    if any(node is each for each in inside):
        line = node.start_mark.line + 1
        raise InputError(f"{path}:{line}: what is named here holds itself; expected no such alias")
    inside = (*inside, node)
    if isinstance(node, yaml.SequenceNode):
        for value in node.value:
            _check_nodes(value, path, "a value", inside)
    if isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, value in node.value:
            if key.value in seen:
                line = key.start_mark.line + 1
                raise InputError(f"{path}:{line}: {key.value} has {what} already")
            seen.add(key.value)
            _check_nodes(value, path, "a value", inside)


def parsed(path: Path, name: str, entry: dict[str, Any]) -> Override:
    """One entry of a labels file, checked.

    Raises:
      InputError: A field is unknown or has a wrong value.
    """
    where = f"{path}: {name}"
    require_known(where, "field", entry, ENTRY_KEYS)
    kind = entry.get("object_type")
    if kind is not None and kind not in SCAN_TYPES:
        if kind in OBJECT_TYPES:
            raise InputError(
                f"{where}: object_type: {kind!r} cannot be chosen; expected {', '.join(SCAN_TYPES)}"
            )
        raise InputError(f"{where}: object_type: {unknown_name('type', str(kind), SCAN_TYPES)}")
    category, mass = entry.get("category"), entry.get("mass")
    if category is not None:
        named = category_of(category).category if isinstance(category, str) else ""
        if not named:
            raise InputError(f"{where}: category: is {category!r}; expected a name such as mug")
        category = named
    if mass is not None:
        mass = numbers(where, "mass", [mass], 1)[0]
        if mass <= 0:
            raise InputError(f"{where}: mass: is {mass:g}; expected a positive number of kg")
    parts = mapping(where, "parts", entry.get("parts", {}))
    for part in parts:
        if not isinstance(part, str):
            raise InputError(
                f'{where}: parts: {part!r} is no text; write the name in quotes: "..."'
            )
    return Override(
        frame=_frame(where, {key: entry[key] for key in FRAME_KEYS if key in entry}),
        object_type=kind,
        up=direction(where, "up", entry),
        functional=direction(where, "functional", entry),
        category=category,
        mass=mass,
        parts={
            name: _part(f"{where}: parts: {name}", mapping(where, f"parts: {name}", part))
            for name, part in parts.items()
        },
        where=where,
        # Last: by now all keys are known to be text, which can be sorted.
        digest=_digest(entry),
    )


def _digest(entry: dict[str, Any]) -> str:
    text = json.dumps(entry, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _part(where: str, entry: dict[str, Any]) -> PartOverride:
    require_known(where, "field", entry, ("handle", "joint"))
    handle = None
    if "handle" in entry:
        handle = _frame(
            f"{where}: handle", mapping(where, "handle", entry["handle"]), keys=HANDLE_KEYS
        )
    joint = mapping(where, "joint", entry.get("joint", {}))
    require_known(f"{where}: joint", "field", joint, ("origin", "axis"))
    origin = None
    if "origin" in joint:
        origin = numbers(where, "joint: origin", joint["origin"], 3)
    return PartOverride(handle, origin, direction(f"{where}: joint", "axis", joint))


def _frame(where: str, entry: dict[str, Any], keys: tuple[str, ...] = FRAME_KEYS) -> FrameOverride:
    require_known(where, "field", entry, keys)
    extents = numbers(where, "extents", entry["extents"], 3) if "extents" in entry else None
    if extents is not None and (extents <= 0).any():
        raise InputError(f"{where}: extents: is {entry['extents']}; expected 3 positive lengths")
    origin = numbers(where, "origin", entry["origin"], 3) if "origin" in entry else None
    symmetry = None
    if "symmetry" in entry:
        name = entry["symmetry"]
        if not isinstance(name, str) or name not in SYMMETRIES:
            raise InputError(f"{where}: symmetry: {unknown_name('group', str(name), SYMMETRIES)}")
        symmetry = SYMMETRIES[name]
    adjust = mapping(where, "adjust", entry.get("adjust", {}))
    require_known(f"{where}: adjust", "field", adjust, ("turn", "shift"))
    return FrameOverride(
        origin=origin,
        rotation=rotation_of(where, entry),
        symmetry=symmetry,
        turn=np.deg2rad(numbers(where, "adjust: turn", adjust.get("turn", [0, 0, 0]), 3)),
        shift=numbers(where, "adjust: shift", adjust.get("shift", [0, 0, 0]), 3),
        extents=extents,
    )
