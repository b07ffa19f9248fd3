"""Furniture to be rendered: a base and the parts that move against it, each opened by some amount."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import trimesh
from jaxtyping import Float

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.visible_shapes import surface, visible_shapes
from manipose_mj.poses import SymmetryGroup, compose, rotation_about
from manipose_mj.ppf_jax.data.rasteriser import Triangles

CATEGORIES = ("cabinet", "microwave", "oven")  # of the catalogue
SYNTHETIC = "synthetic_furniture"  # the category of what is only to train on


@dataclass(frozen=True)
class JointLabel:
    """How a part moves and where it is held, everything shut; object frame.

    Attributes:
      name: The part's.
      hinge: Whether it turns; else it slides.
      origin: `(3,)` [m], a point on the axis.
      axis: `(3,)`, unit; positive is opening.
      travel: From shut to open [m or rad].
      handle: `(4, 4)`, `T_object_handle`.
      handle_extents: `(3,)` [m], along the handle's axes.
      symmetry: Of the handle.
    """

    name: str
    hinge: bool
    origin: Float[np.ndarray, "3"]
    axis: Float[np.ndarray, "3"]
    travel: float
    handle: Float[np.ndarray, "4 4"]
    handle_extents: Float[np.ndarray, "3"]
    symmetry: SymmetryGroup

    def motion(self, opening: float) -> Float[np.ndarray, "4 4"]:
        """What opening by so much does to the part's points, object frame; `opening` [m or rad]."""
        if not self.hinge:
            return compose(np.eye(3), opening * self.axis)
        rotation = rotation_about(self.axis, opening)
        return compose(rotation, self.origin - rotation @ self.origin)


@dataclass(frozen=True)
class ArticulatedSubject:
    """Furniture to be rendered.

    Attributes:
      name: Such as `cabinet_003`.
      category: Such as `cabinet`.
      label: Of the whole, in the object frame: X up, Y out of the front.
      base: All that stays where it is: also parts without a handle, which stay shut.
      parts: The surface of each part that has a handle, shut, object frame.
      joints: Of these, in the same order.
      hull: Corners of the base's convex hull, object frame [m].
    """

    name: str
    category: str
    label: PoseLabel
    base: Triangles
    parts: tuple[Triangles, ...]
    joints: tuple[JointLabel, ...]
    hull: Float[np.ndarray, "h 3"] = field(repr=False)


def catalogue_furniture(category: str, index: int) -> ArticulatedSubject:
    """An articulated object of the catalogue; the index may go beyond the built-in ones."""
    specimen = catalogue.generate(category, index)
    surfaces = {body.name: body.surface() for body in specimen.bodies}
    return _subject(
        catalogue.category_row(category).instance(index),
        category,
        specimen.label,
        surfaces,
        specimen.parts,
    )


def synthetic_furniture(index: int) -> ArticulatedSubject:
    """A piece of furniture that is only to train on."""
    made = catalogue.synthetic_furniture(index)
    base = Triangles.of_mesh(made.base)
    if made.surroundings is not None:
        # Boxes that overlap enclose no volume, whatever their faces say.
        both = [base.corners, np.asarray(made.surroundings.triangles, float)]
        base = Triangles(np.concatenate(both), closed=False)
    return ArticulatedSubject(
        name=f"{SYNTHETIC}_{index:03d}",
        category=SYNTHETIC,
        label=made.label,
        base=base,
        parts=tuple(Triangles.of_mesh(mesh) for mesh in made.surfaces),
        joints=tuple(_joint(part) for part in made.parts),
        hull=_box_corners(base),
    )


def asset_furniture(asset: Asset) -> ArticulatedSubject:
    """A built articulated asset.

    Raises:
      InputError: Its model or a mesh cannot be read.
    """
    shapes = visible_shapes(asset.folder)
    surfaces = {name: surface({name: own}) for name, own in shapes.items() if own}
    return _subject(asset.name, asset.category, asset.label, surfaces, asset.parts)


def _subject(
    name: str,
    category: str,
    label: PoseLabel,
    surfaces: dict[str, trimesh.Trimesh],
    parts: Sequence[MovingPart],
) -> ArticulatedSubject:
    held = {part.name: part for part in parts if part.handle is not None and part.name in surfaces}
    still = [mesh for body, mesh in surfaces.items() if body not in held]
    base = trimesh.util.concatenate([trimesh.Trimesh(m.vertices, m.faces) for m in still])
    return ArticulatedSubject(
        name=name,
        category=category,
        label=label,
        base=Triangles.of_mesh(base),  # pyright: ignore[reportArgumentType]
        parts=tuple(Triangles.of_mesh(surfaces[part]) for part in held),
        joints=tuple(_joint(part) for part in held.values()),
        hull=np.asarray(base.convex_hull.vertices),  # pyright: ignore[reportAttributeAccessIssue]
    )


def _box_corners(surface: Triangles) -> Float[np.ndarray, "8 3"]:
    """`(8, 3)` [m]: the hull is only asked how far it reaches."""
    low, high = surface.corners.min(axis=(0, 1)), surface.corners.max(axis=(0, 1))
    grid = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0]), axis=-1).reshape(-1, 3)
    return low + grid * (high - low)


def _joint(part: MovingPart) -> JointLabel:
    assert part.handle is not None
    low, high = part.joint.range
    return JointLabel(
        name=part.name,
        hinge=part.joint.kind == "hinge",
        origin=np.asarray(part.joint.origin, float),
        axis=np.asarray(part.joint.axis, float),
        travel=float(high - low),
        handle=part.handle.pose,
        handle_extents=np.asarray(part.handle.extents, float),
        symmetry=part.handle.symmetry,
    )
