"""Mass, centre of mass and inertia of solids, thin shells and unions of convex shapes.

Everything goes through the second moments `S = integral of (x - c)(x - c)^T dm`, from which the
inertia is `trace(S) 1 - S`. A symmetric `S` with no negative eigenvalue is the same thing as an
inertia that is positive and obeys the triangle inequality MuJoCo asks for, so that is where both
are ensured.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence

import numpy as np
import trimesh
from jaxtyping import Float

from manipose_mj.assets.geometry import MassProperties, Shape
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

# A sheet of paper or a pin still has this radius of gyration across [m].
MIN_GYRATION = 1e-4


def solid_mass_properties(mesh: trimesh.Trimesh, mass: float) -> MassProperties:
    """Of a homogeneous solid bounded by `mesh`; of its convex hull where the mesh bounds none.

    Args:
      mesh: Surface in the body frame [m].
      mass: Total mass [kg].

    Raises:
      InputError: The mass is not positive, or even the hull has no volume.
    """
    _check_mass(mass)
    if not mesh.is_watertight or mesh.volume <= 0:
        log.warning(
            "mesh of %d faces is open or inside out; its convex hull stands for its mass",
            len(mesh.faces),
        )
        mesh = _hull(mesh)
    volume, center, moments = _solid_moments(mesh)
    return _properties(mass, center, moments * (mass / volume))


def shell_mass_properties(mesh: trimesh.Trimesh, mass: float) -> MassProperties:
    """Of a thin shell: `mass` [kg] spread evenly over the area of `mesh`.

    The second moments of a triangle with corners a, b, c and area A are
    `A / 12 (aa^T + bb^T + cc^T + ss^T)`, `s = a + b + c`: exact.

    Raises:
      InputError: The mass is not positive, or the mesh has no area.
    """
    _check_mass(mass)
    areas = np.asarray(mesh.area_faces)
    if areas.sum() <= 0:
        raise InputError("mesh has no area; expected a surface to spread its mass over")
    weights = mass * areas / areas.sum()
    center = weights @ mesh.triangles_center / mass
    corners = np.asarray(mesh.triangles) - center
    total = corners.sum(axis=1)
    moments = np.einsum("t,tki,tkj->ij", weights, corners, corners)
    moments += np.einsum("t,ti,tj->ij", weights, total, total)
    return _properties(mass, center, moments / 12)


def shape_mass_properties(
    shapes: Sequence[Shape], density: float | Sequence[float]
) -> MassProperties:
    """Of a union of convex shapes that do not overlap, exact for every kind of shape.

    Args:
      shapes: In the body frame.
      density: One for all, or one for each shape [kg/m^3].
    """
    densities = np.broadcast_to(np.asarray(density, float), (len(shapes),))
    return combine([_shape(s, float(d)) for s, d in zip(shapes, densities, strict=True)])


def combine(parts: Iterable[MassProperties]) -> MassProperties:
    """Of several bodies rigidly joined, all given in one frame (parallel axis theorem)."""
    parts = list(parts)
    if not parts:
        raise InputError("no parts to combine; expected at least one with mass")
    mass = sum(p.mass for p in parts)
    center = np.sum([p.mass * p.center_of_mass for p in parts], axis=0) / mass
    moments = np.zeros((3, 3))
    for part in parts:
        offset = part.center_of_mass - center
        moments += second_moments(part.inertia) + part.mass * np.outer(offset, offset)
    return _properties(mass, center, moments)


def second_moments(inertia: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """`integral of x x^T dm` [kg m^2] of an inertia about the same point."""
    return np.trace(inertia) / 2 * np.eye(3) - inertia


def _properties(
    mass: float, center: Float[np.ndarray, "3"], moments: Float[np.ndarray, "3 3"]
) -> MassProperties:
    values, axes = np.linalg.eigh((moments + moments.T) / 2)
    moments = (axes * np.maximum(values, mass * MIN_GYRATION**2)) @ axes.T
    inertia = np.trace(moments) * np.eye(3) - moments
    return MassProperties(float(mass), np.asarray(center, float), (inertia + inertia.T) / 2)


def _shape(shape: Shape, density: float) -> MassProperties:
    if shape.kind == "mesh":
        assert shape.mesh is not None
        volume, center, moments = _solid_moments(_hull(shape.mesh))
        _check_mass(density * volume)
        return _properties(density * volume, center, density * moments)
    volume, diagonal = _primitive_moments(shape)
    _check_mass(density * volume)
    rotation = shape.pose[:3, :3]
    moments = (rotation * (density * diagonal)) @ rotation.T
    return _properties(density * volume, shape.pose[:3, 3], moments)


def _primitive_moments(shape: Shape) -> tuple[float, Float[np.ndarray, "3"]]:
    """Volume and the second moments along the shape's own axes, at unit density."""
    if shape.kind == "box":
        half = np.asarray(shape.size, float)
        volume = 8 * half.prod()
        return volume, volume * half**2 / 3
    if shape.kind in ("sphere", "ellipsoid"):
        radii = np.broadcast_to(np.asarray(shape.size, float), (3,))
        volume = 4 / 3 * np.pi * radii.prod()
        return volume, volume * radii**2 / 5
    radius, half = shape.size[:2]
    tube = 2 * np.pi * radius**2 * half
    moments = tube * np.array([radius**2 / 4, radius**2 / 4, half**2 / 3])
    if shape.kind == "cylinder":
        return tube, moments
    ball = 4 / 3 * np.pi * radius**3
    along = radius**2 / 5 + half**2 + 3 / 4 * half * radius  # two half balls, their flats at +-half
    return tube + ball, moments + ball * np.array([radius**2 / 5, radius**2 / 5, along])


def _solid_moments(
    mesh: trimesh.Trimesh,
) -> tuple[float, Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Volume, centre and second moments about it, at unit density."""
    middle = mesh.bounds.mean(axis=0)  # integrals about a far origin would cancel
    found = trimesh.triangles.mass_properties(mesh.triangles - middle, density=1.0)
    return (
        float(found.volume),
        found.center_mass + middle,
        second_moments(np.asarray(found.inertia)),
    )


def _hull(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    try:
        hull = mesh.convex_hull
    except Exception as error:  # qhull's own type, for flat or empty input
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise InputError(f"mesh has no convex hull ({reason}); expected a solid shape") from None
    if hull.volume <= 0:
        raise InputError("mesh encloses no volume; expected a solid shape")
    return hull


def _check_mass(mass: float) -> None:
    if not (np.isfinite(mass) and mass > 0):
        raise InputError(f"mass is {mass}; expected a positive number of kilograms")
