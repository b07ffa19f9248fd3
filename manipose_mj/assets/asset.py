"""The asset folder: the contract between the pipeline that writes it and the packages that read it.

A folder holds `asset.json`, `model.xml` (loads alone), `meshes/` and, for rigid objects, `grasps.json`.
SI units; every vector in the object frame, which is the mesh frame and the model's body frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.geometry import Joint, MassProperties
from manipose_mj.assets.label import ObjectType, PoseLabel
from manipose_mj.assets.label_quality import LabelQuality
from manipose_mj.errors import InputError
from manipose_mj.poses import compose
from manipose_mj.storage.cache_root import cache_root

SCHEMA_VERSION = 1
ASSET_FILE = "asset.json"
MODEL_FILE = "model.xml"
GRASPS_FILE = "grasps.json"
MIN_HELD = 20  # grasps that survive a lift and a shake, from which on an object counts as graspable


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
      held: The first so many survived a lift and a shake in simulation.
      tried: So many were tried; those that failed are left out. None: nobody has tried.
    """

    poses: Float[np.ndarray, "n 4 4"]
    widths: Float[np.ndarray, "n"]
    clear: np.ndarray
    held: int = 0
    tried: int | None = None

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def graspable(self) -> bool | None:
        """Whether enough of them held; None where nobody has tried."""
        return None if self.tried is None else self.held >= MIN_HELD


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
class Area:
    """A part of an object with a purpose: a box along the label's axes.

    Attributes: use, `"grip"` where it is held or `"functional"` where it does its work (a blade, a
    bristle head, a mug's opening); center `(3,)` [m] in the label frame; extents `(3,)` [m], full
    lengths along the label's X, Y, Z.
    """

    use: Literal["grip", "functional"]
    center: Float[np.ndarray, "3"]
    extents: Float[np.ndarray, "3"]


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
    """A built asset, as read from its folder. Fields as in `asset.json`.

    `label_quality` is None where the label was not measured: made with the shape, or set by a person.
    """

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
    areas: tuple[Area, ...] = ()
    grasps: GraspSet | None = None
    label_quality: LabelQuality | None = None

    @property
    def place(self) -> str:
        """How errors call it: its folder, or its name where it is built in, whose folder nobody has chosen."""
        return self.name if cache_root() in self.folder.parents else str(self.folder)

    @property
    def model_path(self) -> Path:
        """The MJCF file."""
        return self.folder / MODEL_FILE

    @property
    def object_type(self) -> ObjectType:
        """Which rule of the conventions labels it."""
        return self.label.object_type

    @property
    def graspable(self) -> bool | None:
        """Whether enough grasps hold in simulation, or a moving part has a handle."""
        if self.kind == "articulated":
            return any(part.handle is not None for part in self.parts)
        return None if self.grasps is None else self.grasps.graspable

    def part(self, name: str) -> MovingPart:
        """The moving part of this name.

        Raises:
          InputError: There is none.
        """
        for part in self.parts:
            if part.name == name:
                return part
        known = ", ".join(p.name for p in self.parts) or "none"
        raise InputError(f"{self.place}: no moving part {name!r}; parts: {known}")
