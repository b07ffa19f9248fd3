"""An articulated object as a source delivers it: links of named part meshes, and how they move."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Float

from manipose_mj.assets.asset import Provenance

# What a moving link is for: a knob turns, a button gives way, a tray turns or slides inside; none of them opens anything.
LinkRole = Literal["door", "drawer", "lid", "knob", "button", "tray"]
HANDLE = "handle"  # what a part is named that is held to open a link


@dataclass(frozen=True)
class Surface:
    """One mesh of one look.

    Attributes:
      mesh: Triangles in the object frame, everything shut [m]; with `uv` where it has a texture.
      rgba: Its colour.
      texture: The image that the `uv` refer to, or None.
    """

    mesh: trimesh.Trimesh
    rgba: tuple[float, float, float, float]
    texture: Path | None = None


@dataclass(frozen=True)
class PartMesh:
    """A named part of a link, such as `"handle"` or `"cabinet_door_surface"`.

    Attributes:
      name: What it is, without the number that tells it from its like.
      key: The name with that number: meshes of one key are one part.
      surfaces: Its meshes, one for each colour or texture of each file.
    """

    name: str
    key: str
    surfaces: tuple[Surface, ...]

    @property
    def mesh(self) -> trimesh.Trimesh:
        """The geometry alone, in the object frame."""
        vertices = [np.asarray(s.mesh.vertices) for s in self.surfaces]
        starts = np.cumsum([0, *map(len, vertices)])
        faces = [np.asarray(s.mesh.faces) + n for s, n in zip(self.surfaces, starts, strict=False)]
        return trimesh.Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)


@dataclass(frozen=True)
class LinkJoint:
    """How a link moves against the base; in the object frame, the link shut at zero.

    Attributes:
      kind: `"slide"` or `"hinge"`.
      origin: `(3,)` [m], a point on the axis.
      axis: `(3,)`, unit; positive is opening (turning a knob, pressing a button).
      travel: From shut to open [m or rad].
    """

    kind: Literal["slide", "hinge"]
    origin: Float[np.ndarray, "3"]
    axis: Float[np.ndarray, "3"]
    travel: float


@dataclass(frozen=True)
class ScanLink:
    """A rigid piece of the object. The base has neither joint nor role."""

    name: str
    parts: tuple[PartMesh, ...]
    joint: LinkJoint | None = None
    role: LinkRole | None = None


@dataclass(frozen=True)
class ArticulatedScan:
    """One articulated object in metres: z up, the front towards -x, standing on z = 0, shut.

    Attributes:
      name: Of the asset to build.
      category: What kind of object it is, such as `"microwave"`.
      base: The link that does not move.
      moving: The links that do, each against the base.
      appliance: Whether its walls are sheet metal around foam and air; else they are board.
      provenance: Source, item, licence and hashes of the input files.
    """

    name: str
    category: str
    base: ScanLink
    moving: tuple[ScanLink, ...]
    appliance: bool
    provenance: Provenance
