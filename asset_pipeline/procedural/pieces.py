"""Objects put together from pieces of one material each, with the label that follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.geometry.mass import combine, solid_mass_properties
from asset_pipeline.procedural.specimen import Colour, Specimen
from manipose_mj.assets.asset import Area
from manipose_mj.assets.geometry import Body, MassProperties, Shape
from manipose_mj.assets.label import ObjectType, PoseLabel
from manipose_mj.poses import SymmetryGroup, compose, transform

# Columns X, Y, Z of an upright object whose Y is the frame's x: X is up.
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
ROLLING = (0.8, 0.005, 0.0005)


@dataclass(frozen=True)
class Piece:
    """A part of an object. Attributes: visual, what is seen; collision, convex shapes; mass."""

    visual: tuple[Shape, ...]
    collision: tuple[Shape, ...]
    mass: MassProperties


@dataclass(frozen=True)
class AreaBox:
    """An area between two corners of the generator's frame [m], whose axes are the label's."""

    use: Literal["grip", "functional"]
    low: Float[np.ndarray, "3"] | tuple[float, float, float]
    high: Float[np.ndarray, "3"] | tuple[float, float, float]


def solid_piece(
    mesh: trimesh.Trimesh, collision: Sequence[Shape], *, rgba: Colour, density: float
) -> Piece:
    """A massive piece of one colour inside a closed surface; density in [kg/m^3]."""
    mass = solid_mass_properties(mesh, density * float(mesh.volume))
    return Piece((Shape("mesh", mesh=mesh, rgba=rgba),), tuple(collision), mass)


def placed(piece: Piece, pose: Float[np.ndarray, "4 4"]) -> Piece:
    """The piece moved by a rigid transform."""
    turn, mass = pose[:3, :3], piece.mass
    return Piece(
        tuple(placed_shape(s, pose) for s in piece.visual),
        tuple(placed_shape(s, pose) for s in piece.collision),
        MassProperties(
            mass.mass,
            transform(pose, mass.center_of_mass[None])[0],
            turn @ mass.inertia @ turn.T,
        ),
    )


def placed_shape(shape: Shape, pose: Float[np.ndarray, "4 4"]) -> Shape:
    """The shape moved by a rigid transform."""
    if shape.mesh is None:
        return replace(shape, pose=pose @ shape.pose)
    mesh = shape.mesh.copy()
    mesh.vertices = transform(pose, np.asarray(mesh.vertices))
    return replace(shape, mesh=mesh)


def rigid_specimen(
    name: str,
    pieces: Sequence[Piece],
    *,
    object_type: ObjectType,
    symmetry: SymmetryGroup,
    rotation: Float[np.ndarray, "3 3"] = UPRIGHT,
    origin: Float[np.ndarray, "3"] | None = None,
    areas: Sequence[AreaBox] = (),
    friction: tuple[float, float, float] = ROLLING,
) -> Specimen:
    """The object made of pieces, its frame moved to the centre of what is seen of it.

    Args:
      name: Of the body.
      pieces: In the generator's frame, z up.
      object_type: The labelling rule.
      symmetry: In the label frame.
      rotation: Columns are the label's axes; signed axes of the generator's frame where there are
        `areas`.
      origin: `(3,)` [m], the label's origin; None for the centre of the bounding box.
      areas: Where the object is held and where it does its work.
      friction: MuJoCo's sliding, torsional and rolling friction.
    """
    points = np.concatenate(
        [np.asarray(s.surface().vertices) for piece in pieces for s in piece.visual]
    )
    local = points @ rotation
    low, high = local.min(axis=0), local.max(axis=0)
    center = rotation @ ((low + high) / 2)
    at = center if origin is None else np.asarray(origin, float)
    moved = [placed(piece, compose(np.eye(3), -center)) for piece in pieces]
    body = Body(
        name=name,
        collision=tuple(s for piece in moved for s in piece.collision),
        visual=tuple(s for piece in moved for s in piece.visual),
        mass_properties=combine([piece.mass for piece in moved]),
        friction=friction,
    )
    label = PoseLabel(at - center, rotation, object_type, high - low, symmetry)
    return Specimen(label, (body,), areas=tuple(_area(a, rotation, at) for a in areas))


def _area(box: AreaBox, rotation: np.ndarray, origin: np.ndarray) -> Area:
    corners = (np.array([box.low, box.high], float) - origin) @ rotation
    low, high = corners.min(axis=0), corners.max(axis=0)
    return Area(box.use, (low + high) / 2, high - low)
