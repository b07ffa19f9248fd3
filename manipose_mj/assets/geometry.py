"""What an asset is made of before it is written: shapes, bodies, joints."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, cast

import numpy as np
import trimesh
from jaxtyping import Float

from manipose_mj.poses import transform

PrimitiveKind = Literal["box", "cylinder", "capsule", "sphere", "ellipsoid"]


@dataclass(frozen=True)
class Shape:
    """One geom in the frame of the body that carries it.

    Attributes:
      kind: A MuJoCo primitive, or `"mesh"`.
      size: MuJoCo's size of a primitive (half lengths; radius, then half length) [m]; empty for a mesh.
      pose: `T_body_shape`; the identity for a mesh.
      mesh: The mesh in the body frame, for `kind="mesh"`. As collision shape: convex.
      rgba: Colour, for visual shapes.
      texture: A PNG that the mesh's `uv` refer to, for visual meshes.
    """

    kind: PrimitiveKind | Literal["mesh"]
    size: tuple[float, ...] = ()
    pose: Float[np.ndarray, "4 4"] = field(default_factory=lambda: np.eye(4))
    mesh: trimesh.Trimesh | None = None
    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)
    texture: Path | None = None

    def surface(self, sections: int = 48) -> trimesh.Trimesh:
        """The shape as a triangle mesh in the body frame."""
        if self.kind == "mesh":
            assert self.mesh is not None
            return self.mesh
        if self.kind == "box":
            mesh = trimesh.creation.box(extents=2 * np.asarray(self.size))
        elif self.kind == "cylinder":
            mesh = trimesh.creation.cylinder(self.size[0], 2 * self.size[1], sections=sections)
        elif self.kind == "capsule":
            count = (sections // 4, sections)  # of rings and around; the ends hardly ever touch
            mesh = trimesh.creation.capsule(
                height=2 * self.size[1], radius=self.size[0], count=count
            )
            mesh.apply_translation(-mesh.bounds.mean(axis=0))
        else:
            mesh = trimesh.creation.icosphere(subdivisions=3)
            mesh.apply_scale(np.broadcast_to(np.asarray(self.size), (3,)))
        mesh.vertices = transform(self.pose, np.asarray(mesh.vertices))
        return mesh


@dataclass(frozen=True)
class MassProperties:
    """Attributes: mass [kg]; center_of_mass `(3,)` [m]; inertia `(3, 3)` [kg m^2] about it, body axes."""

    mass: float
    center_of_mass: Float[np.ndarray, "3"]
    inertia: Float[np.ndarray, "3 3"]


@dataclass(frozen=True)
class Joint:
    """How a part moves against its parent.

    Attributes:
      kind: `"slide"` or `"hinge"`.
      origin: `(3,)` [m], a point on the axis, in the object frame.
      axis: `(3,)`, unit direction in the object frame; positive is opening.
      range: Limits [m or rad]; the first is shut.
      frictionloss: Dry friction [N or N m]; what keeps a drawer shut.
      damping: [N s/m or N m s/rad].
    """

    kind: Literal["slide", "hinge"]
    origin: Float[np.ndarray, "3"]
    axis: Float[np.ndarray, "3"]
    range: tuple[float, float]
    frictionloss: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True)
class Body:
    """One rigid body: what it collides with, what it looks like, what it weighs.

    The frame of every body is the object frame with all joints at zero.

    Attributes:
      name: Unique within the asset.
      collision: Convex shapes; the exact decomposition, or CoACD's.
      visual: What is seen.
      mass_properties: Mass, centre and inertia.
      joint: How it moves against the asset's base; None for the base and for rigid objects.
      friction: MuJoCo's sliding, torsional and rolling friction; without the last, round things never
        come to rest.
      excluded: Bodies of the asset that it makes no contact with, where what was drawn overlaps.
      balanced: Share of its weight that springs carry, as they do an oven's door.
    """

    name: str
    collision: tuple[Shape, ...]
    visual: tuple[Shape, ...]
    mass_properties: MassProperties
    joint: Joint | None = None
    friction: tuple[float, float, float] = (0.8, 0.005, 0.0005)
    excluded: tuple[str, ...] = ()
    balanced: float = 0.0

    def surface(self) -> trimesh.Trimesh:
        """All visual shapes as one mesh in the object frame."""
        return cast(trimesh.Trimesh, trimesh.util.concatenate([s.surface() for s in self.visual]))
