"""Labels as a person overrode them: frames moved, or measured again from what the person said."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.geometry.surface_points import surface_points
from asset_pipeline.labelling.overrides.other_axes import require_on_axis, symmetries_along
from asset_pipeline.labelling.overrides.reading import FrameOverride, Override, PartOverride
from asset_pipeline.labelling.scan_label import scan_label
from manipose_mj.assets.asset import Area, Asset, MovingPart
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.geometry import MassProperties
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.label_quality import LabelQuality
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.poses import SymmetryGroup, compose, invert, rotation_about, transform

log = logging.getLogger(__name__)

# In lengths of an object's diagonal: from its middle its label's origin, from its box a handle or a hinge can be.
_FARTHEST = 3
_DENSEST = 22_600.0  # of all matter: osmium [kg/m^3]
_LIGHTEST = 1.2  # air
_BESIDE = 0.01  # of a handle's box from what is seen, at most [m]
_SPACING = 0.0025  # of points there [m]


def overridden(
    asset: Asset,
    override: Override,
    surface: trimesh.Trimesh,
    *,
    textured: bool,
    texture: Path | None = None,
) -> Asset:
    """The asset with what a person said in place of what was measured.

    Another object type, up or functional direction has the label measured again; so has another
    category of a tool, whose grip end it tells, or whose catalogue type is another. Origin, axes and adjustments
    come after that.

    Args:
      asset: As measured.
      override: The person's word.
      surface: What is seen of the object, in the mesh frame, everything shut [m]; with `uv` where `texture` is given.
      textured: Whether it has a texture.
      texture: Its image, for which symmetries the print has; without, see `scan_label`.

    Raises:
      InputError: The object has no such part, handle or mass of its own; it cannot be measured; or its
        symmetry has to be said with its axes.
    """
    if asset.kind == "articulated":
        for key in ("object_type", "functional", "mass", "up"):
            if getattr(override, key) is not None:
                raise InputError(
                    f"{override.where}: {key}: an articulated object's follows from its parts; "
                    "expected this field for rigid objects only"
                )
    for name in override.parts:
        if name not in [part.name for part in asset.parts]:
            raise InputError(
                f"{override.where}: {unknown_name('part', name, [p.name for p in asset.parts])}"
            )
    category = override.category or asset.category
    told = CATALOGUE.get(override.category or "")
    if asset.kind != "articulated" and told is not None and told.object_type == "articulated":
        raise InputError(
            f"{override.where}: category: {category} has parts that move; expected that of a rigid object"
        )
    up = asset.up if override.up is None else override.up
    found, quality = _measured(asset, override, surface, category, up, textured, texture)
    label = _moved(found, override.frame, override.where)
    _check_units(override, label, surface)
    if override.frame.symmetry is None:
        require_on_axis(found, label.origin, override.where)
    parts = tuple(_part(override, part, surface) for part in asset.parts)
    if label is not found:
        quality = None  # a person's word
    if label is not asset.label:
        along = (surface.vertices - label.origin) @ label.rotation
        middle = (along.min(axis=0) + along.max(axis=0)) / 2
        label = replace(label, extents=np.ptp(along, axis=0), center=middle)
    return replace(
        asset,
        category=category,
        up=up,
        label=label,
        label_quality=quality,
        mass_properties=_weighed(asset.mass_properties, override.mass),
        parts=parts,
        areas=tuple(_area(area, asset.label, label) for area in asset.areas),
    )


def _check_units(override: Override, label: PoseLabel, surface: trimesh.Trimesh) -> None:
    """Raise `InputError` for millimetres and grams."""
    low, high = surface.bounds
    size = float(np.linalg.norm(high - low))
    away = float(np.linalg.norm(label.origin - (low + high) / 2))
    if away > _FARTHEST * size:
        raise InputError(
            f"{override.where}: the origin is {away:.3g} m from the middle of an object of {size:.3g} m; expected metres"
        )
    if override.mass is None:
        return
    volume = float(surface.convex_hull.volume)
    for wrong, what in (
        (override.mass > _DENSEST * volume, "more than osmium"),
        (override.mass < _LIGHTEST * volume, "less than air"),
    ):
        if wrong:
            raise InputError(
                f"{override.where}: mass {override.mass:g} kg is {what} of that size weighs; expected kilograms"
            )


def _check_near(
    point: Float[np.ndarray, "3"],
    surface: trimesh.Trimesh,
    where: str,
) -> None:
    """Raise `InputError` for a part's point in millimetres."""
    low, high = surface.bounds
    size = float(np.linalg.norm(high - low))
    away = float(np.linalg.norm(point - np.clip(point, low, high)))
    if away > _FARTHEST * size:
        raise InputError(
            f"{where}: is {away:.3g} m from an object of {size:.3g} m; expected metres"
        )


def _check_length(extents: Float[np.ndarray, "3"], surface: trimesh.Trimesh, where: str) -> None:
    """Raise `InputError` for a handle's lengths in millimetres."""
    size = float(np.linalg.norm(np.ptp(surface.bounds, axis=0)))
    longest = float(extents.max())
    if longest > size:
        raise InputError(
            f"{where}: reach {longest:.3g} m along an object of {size:.3g} m; expected metres"
        )


def _is_seen(label: PoseLabel, surface: trimesh.Trimesh) -> bool:
    """Whether some of the surface is in the label's box or beside it."""
    most = label.extents / 2 + _BESIDE
    own = (np.asarray(surface.vertices) - label.origin) @ label.rotation
    corners = own[np.asarray(surface.faces)]
    near = ((corners.min(axis=1) <= most) & (corners.max(axis=1) >= -most)).all(axis=1)
    if not near.any():
        return False
    mesh = trimesh.Trimesh(own, np.asarray(surface.faces)[near], process=False)
    return bool((np.abs(surface_points(mesh, _SPACING)) <= most).all(axis=1).any())


def moved(label: PoseLabel, frame: FrameOverride) -> PoseLabel:
    """The label with another frame or symmetry; its extents are those of the old box in the new axes.

    Raises:
      InputError: Its symmetry is not said, and cannot be that of the label; see `symmetries_along`.
    """
    if not frame_says_something(frame):
        return label
    origin = label.origin if frame.origin is None else frame.origin
    rotation = label.rotation if frame.rotation is None else frame.rotation
    origin = origin + rotation @ frame.shift
    for axis, angle in zip(np.eye(3), frame.turn, strict=True):
        rotation = rotation @ rotation_about(axis, angle)
    if frame.symmetry is None:
        symmetry, printed = symmetries_along(label, rotation)
    else:
        symmetry, printed = frame.symmetry, None
    return replace(
        label,
        origin=origin,
        rotation=rotation,
        extents=_box_along(rotation.T @ label.rotation, label.extents)
        if frame.extents is None
        else frame.extents,
        symmetry=symmetry,
        print_symmetry=printed,
    )


def _moved(label: PoseLabel, frame: FrameOverride, where: str) -> PoseLabel:
    """The same, with `where` before what is wrong."""
    try:
        return moved(label, frame)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def frame_says_something(frame: FrameOverride) -> bool:
    """Whether the frame differs in anything from no override."""
    named = (frame.origin, frame.rotation, frame.symmetry, frame.extents)
    return any(v is not None for v in named) or bool(frame.turn.any() or frame.shift.any())


def _measured(
    asset: Asset,
    override: Override,
    surface: trimesh.Trimesh,
    category: str,
    up: Float[np.ndarray, "3"],
    textured: bool,
    texture: Path | None,
) -> tuple[PoseLabel, LabelQuality | None]:
    """The asset's label, or a new one where what it was measured from is another."""
    if asset.kind == "articulated":
        return asset.label, asset.label_quality
    object_type = override.object_type or asset.label.object_type
    if override.object_type is None and category != asset.category and category in CATALOGUE:
        object_type = CATALOGUE[category].object_type
    told = (override.object_type, override.up, override.functional)
    another = any(v is not None for v in told) or object_type != asset.label.object_type
    if object_type == "functional":
        another = another or category != asset.category
    if not another:
        return asset.label, asset.label_quality
    if override.frame.whole:
        return replace(asset.label, object_type=object_type), None
    try:
        return scan_label(
            surface,
            object_type,
            up,
            category=category,
            functional=override.functional,
            textured=textured,
            texture=texture,
        )
    except InputError as error:
        raise InputError(f"{override.where}: cannot be measured as told ({error})") from None


def _part(override: Override, part: MovingPart, surface: trimesh.Trimesh) -> MovingPart:
    said: PartOverride | None = override.parts.get(part.name)
    if said is None:
        return part
    handle, joint = part.handle, part.joint
    where = f"{override.where}: parts: {part.name}"
    if said.handle is not None:
        found = handle or _new_handle(override, part.name, said.handle)
        handle = _moved(found, said.handle, f"{where}: handle")
        _check_near(handle.origin, surface, f"{where}: handle: origin")
        _check_length(handle.extents, surface, f"{where}: handle: extents")
        if not _is_seen(handle, surface):
            log.warning(
                "%s: handle: nothing of the object is within %g mm of it; expected it where a handle is seen",
                where,
                1e3 * _BESIDE,
            )
    if said.joint_origin is not None:
        _check_near(said.joint_origin, surface, f"{where}: joint: origin")
        joint = replace(joint, origin=said.joint_origin)
    if said.joint_axis is not None:
        joint = replace(joint, axis=said.joint_axis)
    return replace(part, handle=handle, joint=joint)


def _new_handle(override: Override, part: str, frame: FrameOverride) -> PoseLabel:
    """The label of a handle that was not found."""
    if frame.origin is None or frame.rotation is None or frame.extents is None:
        raise InputError(
            f"{override.where}: parts: {part}: handle: none was found; "
            "a new one needs origin, x, y and extents"
        )
    return PoseLabel(
        frame.origin, frame.rotation, "handle", frame.extents, SymmetryGroup.identity()
    )


def _weighed(properties: MassProperties, mass: float | None) -> MassProperties:
    if mass is None:
        return properties
    return replace(properties, mass=mass, inertia=properties.inertia * (mass / properties.mass))


def _area(area: Area, old: PoseLabel, new: PoseLabel) -> Area:
    """The same place in another label's frame: the smallest box along its axes."""
    if new is old:
        return area
    T_new_old = invert(compose(new.rotation, new.origin)) @ old.pose
    return replace(
        area,
        center=transform(T_new_old, area.center[None])[0],
        extents=_box_along(T_new_old[:3, :3], area.extents),
    )


def _box_along(
    rotation: Float[np.ndarray, "3 3"], extents: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3"]:
    """Lengths of the smallest box along other axes around a box with these lengths."""
    return np.abs(rotation) @ extents
