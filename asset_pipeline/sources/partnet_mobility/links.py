"""From a URDF's tree of links to a base and the links that move against it, shut and in metres."""

from __future__ import annotations

import logging
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.sources.articulated_scan import (
    HANDLE,
    LinkJoint,
    LinkRole,
    PartMesh,
    ScanLink,
    Surface,
)
from asset_pipeline.sources.drawn_handle import body_bounds, is_knob
from asset_pipeline.sources.partnet_mobility.record import Semantics, compare_size, pose_of
from asset_pipeline.sources.partnet_mobility.roles import named_role, shaped_role
from asset_pipeline.sources.partnet_mobility.sizes import CategorySize, likely_scale
from asset_pipeline.sources.partnet_mobility.urdf import Urdf, UrdfJoint
from asset_pipeline.sources.partnet_mobility.wavefront import read_wavefront
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, rotation_about, transform

log = logging.getLogger(__name__)

FULL_TURN = 2 * np.pi
MOVES = ("revolute", "prismatic", "continuous")
MIN_TRAVEL = {"slide": 5e-4, "hinge": np.deg2rad(1.0)}  # [m, rad]; less is as good as fixed
CONTROL = "control"  # what a knob is called that has a joint of its own on a door or a drawer
MAX_SIZE = 4.0  # [m]
_ROUNDED = 0.01  # what a whole turn may be written as more than it is
_SMALLER = 0.999  # boxes that differ by less are alike
_LARGER = 1 + 1e-9  # scales that differ by less are one
_BOTH_SIDES = (
    0.1  # of a range on either side of where a part is drawn, from which on that is no slip
)
DOOR_TRAVEL = np.pi / 2  # of a door whose limits nobody stated


def normalised_links(
    folder: Path, urdf: Urdf, semantics: dict[str, Semantics]
) -> tuple[ScanLink, list[ScanLink]]:
    """The base and the moving links, shut, in the URDF's root frame and unit.

    Raises:
      InputError: A mesh cannot be used, or a link is left without any.
    """
    groups: dict[str, list[PartMesh]] = {}
    joints: dict[str, UrdfJoint] = {}
    lacking: list[str] = []
    for link in urdf.visuals:
        chain = urdf.chain(link)
        moving = [j for j in chain if j.kind in MOVES]
        for joint in chain[-1:]:
            if joint.kind not in (*MOVES, "fixed") or len(moving) > 1 and joint.kind in MOVES:
                log.warning(
                    "%s: link %r (%s) is taken as fixed to what it hangs on",
                    folder,
                    link,
                    joint.kind,
                )
        top = moving[0].child if moving else urdf.root
        if moving:
            joints[top] = moving[0]
        parts = _parts(folder, urdf, link, lacking)
        if len(moving) > 1:  # what turns on a door is no handle of it
            parts = [replace(p, name=CONTROL) if is_knob(p) else p for p in parts]
        groups.setdefault(top, []).extend(parts)
    if lacking:
        more = f" and {len(lacking) - 1} more like it" if len(lacking) > 1 else ""
        log.warning("%s%s; drawn in plain colours", lacking[0], more)
    compare_size(folder, _mesh_bounds(urdf, groups))
    base = ScanLink("base", tuple(groups.pop(urdf.root, ())))
    if not base.parts:
        raise InputError(
            f"{folder}: nothing is fixed to the base; expected a body that parts move on"
        )
    found = []
    for name, parts in groups.items():
        if not parts:
            log.warning("%s: link %r has no mesh; left out", folder, name)
            continue
        frame = pose_of(urdf.chain(joints[name].parent)) @ joints[name].pose
        role = _role(joints[name], semantics.get(name), parts, frame)
        log.debug("%s: %s is a %s %s", folder, name, joints[name].kind, role)
        found.append(_shut(ScanLink(name, tuple(parts), None, role), joints[name], frame, base))
    return base, found


def placed_links(
    links: tuple[ScanLink, list[ScanLink]], size: CategorySize
) -> tuple[ScanLink, list[ScanLink]]:
    """The links in metres, the middle of the base above the origin, nothing ever below z = 0.

    An object stands on z = 0 unless a door that opens downwards would sweep below: then it stands as
    much higher, as the plinth or the housing does that such an appliance is built into.

    Args:
      links: Base and moving links, z up and the front towards -x.
      size: How large such things are, handles left out.

    Raises:
      InputError: The object is flat, or would be gigantic.
    """
    base, moving = links
    bodies = [p.mesh for link in (base, *moving) for p in link.parts if p.name != HANDLE]
    low = np.min([m.bounds[0] for m in bodies], axis=0)
    high = np.max([m.bounds[1] for m in bodies], axis=0)
    extents = high - low
    if not (np.isfinite(extents).all() and extents.min() > 1e-6):
        raise InputError(f"the object measures {extents}; expected a solid thing")
    scale = _scale(base, moving, extents, size)
    everything = np.array([p.mesh.bounds for link in (base, *moving) for p in link.parts])
    whole = scale * (everything[:, 1].max(axis=0) - everything[:, 0].min(axis=0))
    if whole.max() > MAX_SIZE:
        raise InputError(
            f"the object would measure {' x '.join(f'{e:.3g}' for e in whole)} m, as large as such a "
            f"{size.category} is; expected a piece of furniture below {MAX_SIZE:g} m"
        )
    lowest = min([low[2], *(_lowest(link) for link in moving)])
    foot = np.array([*_bounds(base)[:, :2].mean(axis=0), lowest])
    kept, frozen = [], list(base.parts)
    for link in moving:
        placed = _scaled(link, scale, foot)
        assert placed.joint is not None
        if placed.joint.kind == "slide" and placed.joint.travel > whole.max():
            raise InputError(
                f"link {link.name!r} slides by {placed.joint.travel:.3g} m, farther than the object of "
                f"{whole.max():.3g} m is long; expected its own depth at most"
            )
        if placed.joint.kind == "slide" and link.role == "drawer" and placed.joint.axis[0] > 0.5:
            log.warning("link %r slides out towards the back; is its axis reversed?", link.name)
        if placed.joint.travel < MIN_TRAVEL[placed.joint.kind]:
            log.warning("link %r moves by %g only; taken as fixed", link.name, placed.joint.travel)
            frozen += link.parts
        else:
            kept.append(placed)
    return _scaled(replace(base, parts=tuple(frozen)), scale, foot), kept


def _scale(
    base: ScanLink, moving: list[ScanLink], extents: Float[np.ndarray, "3"], size: CategorySize
) -> float:
    """The length of the drawing's unit [m]; `extents` are those of all that is not named a handle.

    What the build will take for handles does not count as furniture's depth. Of appliances another side is known, or all
    three, and the depth of an oven varies by more.
    """
    scale = likely_scale(extents, size.builds)
    while not size.appliance:
        # A larger scale may show another handle, and never one less.
        links = [_scaled(link, scale, np.zeros(3)) for link in (base, *moving)]
        whole = _bounds(links[0])
        bodies = [own for link in links if (own := body_bounds(link, whole)) is not None]
        deep = np.max(bodies, axis=0)[1] - np.min(bodies, axis=0)[0]
        larger = scale * likely_scale(deep, size.builds)
        if larger <= _LARGER * scale:
            break
        scale = larger
    return scale


def moved(part: PartMesh, pose: Float[np.ndarray, "4 4"], scale: float = 1.0) -> PartMesh:
    """The part under a rigid transform, then scaled about the origin."""
    surfaces = []
    for surface in part.surfaces:
        points = scale * transform(pose, np.asarray(surface.mesh.vertices))
        mesh = trimesh.Trimesh(points, surface.mesh.faces, process=False)
        mesh.visual = surface.mesh.visual
        surfaces.append(Surface(mesh, surface.rgba, surface.texture))
    return replace(part, surfaces=tuple(surfaces))


def _parts(folder: Path, urdf: Urdf, link: str, lacking: list[str]) -> list[PartMesh]:
    surfaces: dict[str, list[Surface]] = {}
    visuals, pose = urdf.visuals[link], pose_of(urdf.chain(link))
    for visual in visuals:
        path = folder / visual.file
        if not path.is_file():
            log.warning("%s: missing; link %r is built without it", path, link)
            continue
        key = visual.name or link
        part = PartMesh(key, key, read_wavefront(path, folder / "images", lacking))
        if not part.surfaces:
            log.warning("%s: has no faces; link %r is built without it", path, link)
            continue
        surfaces.setdefault(key, []).extend(moved(part, pose @ visual.pose).surfaces)
    if visuals and not surfaces:
        raise InputError(f"{folder}: none of the {len(visuals)} meshes of link {link!r} has a face")
    return [PartMesh(re.sub(r"-\d+$", "", k), k, tuple(s)) for k, s in surfaces.items()]


def _mesh_bounds(urdf: Urdf, groups: dict[str, list[PartMesh]]) -> Float[np.ndarray, "2 3"]:
    """Of all meshes in the frame that they were drawn in, which the joint below the root turns."""
    top = next((j.pose for j in urdf.joints.values() if j.parent == urdf.root), np.eye(4))
    meshes = [p.mesh for parts in groups.values() for p in parts]
    if not meshes:
        raise InputError("no mesh is there; expected those that the URDF names")
    points = [transform(np.linalg.inv(top), np.asarray(mesh.vertices)) for mesh in meshes]
    return np.array([np.min([p.min(axis=0) for p in points], axis=0),
                     np.max([p.max(axis=0) for p in points], axis=0)])  # fmt: skip


def _role(
    joint: UrdfJoint,
    semantics: Semantics | None,
    parts: list[PartMesh],
    frame: Float[np.ndarray, "4 4"],
) -> LinkRole:
    slides = joint.kind == "prismatic"
    named = named_role(slides, semantics.name if semantics else "", [p.name for p in parts])
    if named is not None:
        return named
    if joint.kind == "continuous":
        bounds = _bounds(ScanLink("", tuple(parts)))
        return shaped_role(bounds, frame[:3, 3], frame[:3, :3] @ joint.axis)
    return "drawer" if slides else "door"


def _shut(
    link: ScanLink, joint: UrdfJoint, frame: Float[np.ndarray, "4 4"], base: ScanLink
) -> ScanLink:
    """The link where it is shut, its axis turned so that positive opens.

    Of a door's or a drawer's two limits, the one where link and base share the smaller bounding box is
    shut; of the others, and where the boxes are alike, the lower one. A door that is drawn well between them is shut
    as drawn, and so is a drawer whose box is smaller there than at both; then a drawer opens towards the front, and a
    door the way that takes it farther out of the base. So does a door without limits, by a quarter turn. A sliding
    door stays in front of the base: where the boxes are alike, the limit nearer to where it is drawn is shut.

    Raises:
      InputError: It would turn by more than a whole turn.
    """
    kind: Literal["slide", "hinge"] = "slide" if joint.kind == "prismatic" else "hinge"
    origin, axis = frame[:3, 3], frame[:3, :3] @ joint.axis

    @cache
    def box(value: float) -> float:
        """The volume of the box around the base and the link there."""
        both = np.stack([_bounds(base), _bounds(_turned(link, kind, origin, axis, value))])
        return float(np.prod(both[:, 1].max(axis=0) - both[:, 0].min(axis=0)))

    lower, upper = joint.limits or (0.0, FULL_TURN)
    if kind == "hinge" and upper - lower > (1 + _ROUNDED) * FULL_TURN:
        raise InputError(
            f"link {link.name!r} turns from {lower:g} to {upper:g} rad; expected a whole turn at most: degrees?"
        )
    start, sign = lower, 1.0
    if link.role in ("door", "lid") and joint.limits is None:
        upper = DOOR_TRAVEL
        sign = 1.0 if box(upper) >= box(-upper) else -1.0
    elif link.role in ("door", "drawer", "lid"):
        least = _SMALLER * min(box(lower), box(upper))
        if min(-lower, upper) > _BOTH_SIDES * (upper - lower) and (
            link.role != "drawer" or box(0.0) < least
        ):
            log.warning(
                "link %r moves to both sides of where it is drawn: taken to be shut there",
                link.name,
            )
            out = -axis[0] if link.role == "drawer" else box(upper) - box(lower)
            start, sign = 0.0, 1.0 if out >= 0 else -1.0
            lower, upper = (0.0, upper) if sign > 0 else (lower, 0.0)
        elif box(upper) < _SMALLER * box(lower) or (
            kind == "slide"
            and link.role == "door"
            and -lower > upper
            and box(lower) >= _SMALLER * box(upper)
        ):
            start, sign = upper, -1.0
        if box(0.0) < _SMALLER * box(start):
            log.warning(
                "link %r is never as shut as it is drawn: it moves from %g to %g",
                link.name,
                lower,
                upper,
            )
    joint_of = LinkJoint(kind, origin, sign * axis, upper - lower)
    return replace(_turned(link, kind, origin, axis, start), joint=joint_of)


def _turned(
    link: ScanLink,
    kind: str,
    origin: Float[np.ndarray, "3"],
    axis: Float[np.ndarray, "3"],
    value: float,
) -> ScanLink:
    if kind == "slide":
        pose = compose(np.eye(3), value * axis)
    else:
        turn = rotation_about(axis, value)
        pose = compose(turn, origin - turn @ origin)
    return replace(link, parts=tuple(moved(p, pose) for p in link.parts))


def _lowest(link: ScanLink) -> float:
    """The lowest height that a link comes to."""
    joint = link.joint
    assert joint is not None
    values = np.linspace(0, joint.travel, 13)
    return min(
        float(_bounds(_turned(link, joint.kind, joint.origin, joint.axis, v))[0, 2]) for v in values
    )


def _bounds(link: ScanLink) -> Float[np.ndarray, "2 3"]:
    bounds = np.array([p.mesh.bounds for p in link.parts])
    return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def _scaled(link: ScanLink, scale: float, foot: Float[np.ndarray, "3"]) -> ScanLink:
    pose = compose(np.eye(3), -foot)
    parts = tuple(moved(p, pose, scale) for p in link.parts)
    if link.joint is None:
        return replace(link, parts=parts)
    joint = link.joint
    travel = joint.travel * (scale if joint.kind == "slide" else 1.0)
    origin = scale * (joint.origin - foot)
    return replace(link, parts=parts, joint=replace(joint, origin=origin, travel=travel))
