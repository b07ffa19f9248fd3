"""What is known about a category: a few of its training objects, with their parts and ways to lie.

An estimate says where an object's label is and how long its sides are, not what it looks like. The
training object that fits the cloud best, stretched to these lengths, stands in for it: the planner
keeps clear of its convex parts, and grasps are sampled on them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree
from shapely import MultiPoint, Point
from trimesh.convex import convex_hull

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset, GraspSet, StablePose
from manipose_mj.assets.geometry import Body, MassProperties, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.visible_shapes import surface, visible_shapes
from manipose_mj.control.scene.geom_corners import geom_corners
from manipose_mj.grasp_sampling.sampler import sample_grasps
from manipose_mj.poses import SymmetryGroup, invert, transform

SHAPES = 8  # training objects of a category that are known: its styles take turns among them
_SURFACE_POINTS = 1500
_ALIKE = 0.04  # relative difference of two lengths from which on a turn no longer exchanges them
# Sides nearer to each other than this are one [rad]; at most so many are others' alone, with this probability; how far a
# corner may be from what it lies on, and its centre of mass from being above that [m].
_SIDE, _SIDES, _RARE, _UNEVEN = np.deg2rad(12.0), 3, 0.01, 0.003
_FAR = (
    0.02  # a point further from the surface counts as this far: it is noise or somebody else's [m]
)


@dataclass(frozen=True)
class KnownShape:
    """An object in its label frame.

    Attributes:
      name: Of the training object.
      label: In this frame: its pose is the identity.
      hulls: Vertices of the convex parts, `(v, 3)` each [m].
      surface: `(m, 3)`, random points of what is seen of it [m].
      rests: Stable poses, of the label frame.
      mass: As of the training object; its centre [m].
    """

    name: str
    label: PoseLabel
    hulls: tuple[Float[np.ndarray, "_ 3"], ...]
    surface: Float[np.ndarray, "m 3"]
    rests: tuple[StablePose, ...]
    mass: MassProperties

    @property
    def extents(self) -> Float[np.ndarray, "3"]:
        """Lengths of the bounding box along the label's axes [m]."""
        return self.label.extents

    def stretched(self, extents: Float[np.ndarray, "3"]) -> KnownShape:
        """The same shape with other lengths [m], lying on the same sides."""
        scale = np.asarray(extents, float) / self.extents
        hulls = tuple(hull * scale for hull in self.hulls)
        corners = np.concatenate(hulls)
        rests = tuple(
            replace(rest, height=-float((corners @ rest.rotation[2]).min())) for rest in self.rests
        )
        symmetry = _kept(self.label.symmetry, np.asarray(extents, float))
        return KnownShape(
            name=self.name,
            label=replace(
                self.label,
                extents=np.asarray(extents, float),
                symmetry=symmetry,
                center=self.label.center * scale,
            ),
            hulls=hulls,
            surface=self.surface * scale,
            rests=rests,
            mass=replace(self.mass, center_of_mass=self.mass.center_of_mass * scale),
        )

    def sampled_grasps(self) -> GraspSet:
        """Antipodal grasps of the convex parts, clear of the support in each of `rests`."""
        parts = tuple(Shape("mesh", mesh=convex_hull(hull)) for hull in self.hulls)
        body = Body(self.name, collision=parts, visual=parts, mass_properties=self.mass)
        return sample_grasps(body, self.rests)

    def misfit(self, points_label: Float[np.ndarray, "n 3"]) -> float:
        """Mean distance of points in the label frame from the surface, none counted beyond 2 cm [m]."""
        distance, _ = cKDTree(self.surface).query(points_label, distance_upper_bound=_FAR)
        return float(np.minimum(distance, _FAR).mean())


def best_fit(
    shapes: Sequence[KnownShape],
    extents: Float[np.ndarray, "3"],
    points_label: Float[np.ndarray, "n 3"],
) -> tuple[KnownShape, float]:
    """The shape that, stretched to `extents` [m], is nearest to the points; and its misfit [m]."""
    return nearest_shape([shape.stretched(extents) for shape in shapes], points_label)


def nearest_shape(
    shapes: Sequence[KnownShape], points_label: Float[np.ndarray, "n 3"]
) -> tuple[KnownShape, float]:
    """The shape that, as it is, is nearest to the points; and its misfit [m]."""
    misfits = [shape.misfit(points_label) for shape in shapes]
    best = int(np.argmin(misfits))
    return shapes[best], misfits[best]


@cache
def known_shapes(category: str) -> tuple[KnownShape, ...]:
    """The first `SHAPES` training objects of a category; built on first use.

    Raises:
      InputError: There is no such category.
    """
    count = len(catalogue.instances(category))  # refuses what is no category
    row = catalogue.CATALOGUE[category]
    training = [index for index in range(count) if row.split(index) == "train"]
    shapes = [shape_of(catalogue.load(category, index)) for index in training[:SHAPES]]
    return tuple(_resting_as(shape, shapes) for shape in shapes)


def shape_of(asset: Asset) -> KnownShape:
    """A built rigid asset as a known shape."""
    to_label = invert(asset.label.pose)
    mesh = surface(visible_shapes(asset.folder))
    samples = mesh.sample(_SURFACE_POINTS, seed=0)
    mass = asset.mass_properties
    hulls = tuple(transform(to_label, hull) for hull in _collision_hulls(asset))
    rests = tuple(
        StablePose(
            rotation=rest.rotation @ asset.label.rotation,
            height=rest.height + float(rest.rotation[2] @ asset.label.origin),
            probability=rest.probability,
        )
        for rest in asset.stable_poses
    )
    return KnownShape(
        name=asset.name,
        label=replace(asset.label, origin=np.zeros(3), rotation=np.eye(3)),
        hulls=hulls,
        surface=transform(to_label, np.asarray(samples, float)),
        rests=rests,
        mass=replace(mass, center_of_mass=transform(to_label, mass.center_of_mass[None])[0]),
    )


def _resting_as(shape: KnownShape, others: Sequence[KnownShape]) -> KnownShape:
    """The shape, which may also lie on the sides that most others of its category lie on.

    It stands in for objects of other proportions, such as mugs that lie still with the handle up where its own rolls.
    """
    symmetry = shape.label.symmetry
    sides: list[tuple[int, StablePose]] = []
    for rest in (rest for other in others for rest in other.rests):
        if any(
            _same_side(rest, known, symmetry)
            for known in (*shape.rests, *(side for _, side in sides))
        ):
            continue
        votes = sum(any(_same_side(rest, own, symmetry) for own in other.rests) for other in others)
        lying = _lying(shape, rest)
        if lying is not None and votes >= len(others) / 2:
            sides.append((votes, lying))
    sides.sort(key=lambda side: -side[0])
    return replace(shape, rests=(*shape.rests, *(side for _, side in sides[:_SIDES])))


def _same_side(one: StablePose, other: StablePose, symmetry: SymmetryGroup) -> bool:
    """Whether two rests of the label's frame are on one side, symmetries apart."""
    up, ups = one.rotation[2], other.rotation[2] @ symmetry.rotations
    if symmetry.axial:
        return bool(
            (np.abs(np.arccos(ups[:, 0].clip(-1, 1)) - np.arccos(up[0].clip(-1, 1))) < _SIDE).any()
        )
    return bool((ups @ up > np.cos(_SIDE)).any())


def _lying(shape: KnownShape, rest: StablePose) -> StablePose | None:
    """The shape turned as `rest`, if it lies still so."""
    turned = np.concatenate(shape.hulls) @ rest.rotation.T
    lowest = float(turned[:, 2].min())
    support = MultiPoint(turned[turned[:, 2] < lowest + _UNEVEN, :2]).convex_hull
    if support.distance(Point(rest.rotation[:2] @ shape.mass.center_of_mass)) > _UNEVEN:
        return None
    return StablePose(rest.rotation, -lowest, _RARE)


def _collision_hulls(asset: Asset) -> list[Float[np.ndarray, "_ 3"]]:
    """Vertices of the convex parts of an asset, object frame [m]."""
    model = mujoco.MjModel.from_xml_path(str(asset.model_path))
    return [geom_corners(model, int(geom)) for geom in np.flatnonzero(model.geom_contype)]


def _kept(symmetry: SymmetryGroup, extents: Float[np.ndarray, "3"]) -> SymmetryGroup:
    """The turns that exchange no sides of different lengths."""
    swapped = np.abs(symmetry.rotations) @ extents
    kept = (np.abs(swapped - extents) <= _ALIKE * extents.max()).all(axis=1)
    return SymmetryGroup(symmetry.rotations[kept], axial=symmetry.axial)
