"""Whether two built assets are the same thing, for all that a user would notice."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import trimesh
from PIL import Image
from scipy.spatial import cKDTree

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.asset_json import read_asset

# What is within these is noise: lengths [m], angles [rad], shares, and grey levels of 255.
LENGTH, ANGLE, SHARE, GREY_LEVELS = 5e-4, np.deg2rad(0.5), 0.01, 2.0


def difference(one: Path, other: Path) -> str:
    """What tells two asset folders apart, in words; empty where nothing does.

    Compared are category, label, mass, joints, compiled body masses, visual geometry (two-sided Hausdorff
    distance of vertices and face centres below 0.5 mm) and textures; not the hashes of the inputs.
    """
    a, b = read_asset(one), read_asset(other)
    if (a.category, a.kind, a.label.object_type) != (b.category, b.kind, b.label.object_type):
        return f"is a {a.label.object_type} {a.category}, not a {b.label.object_type} {b.category}"
    return (
        _labels(a, b)
        or _joints(a, b)
        or _masses(a, b)
        or _geometry(one, other)
        or _textures(one, other)
    )


def _labels(a: Asset, b: Asset) -> str:
    if not np.allclose(a.label.origin, b.label.origin, atol=LENGTH):
        return "the label's origin differs"
    cosine = (np.trace(a.label.rotation.T @ b.label.rotation) - 1) / 2
    if np.arccos(np.clip(cosine, -1, 1)) > ANGLE:
        return "the label's axes differ"
    if not np.allclose(a.label.extents, b.label.extents, atol=2 * LENGTH):
        return "the label's extents differ"
    same = len(a.label.symmetry.rotations) == len(b.label.symmetry.rotations)
    return "" if same else "the symmetry group differs"


def _joints(a: Asset, b: Asset) -> str:
    if [p.name for p in a.parts] != [p.name for p in b.parts]:
        return "the moving parts differ"
    for x, y in zip(a.parts, b.parts, strict=True):
        same = (
            x.joint.kind == y.joint.kind
            and np.allclose(x.joint.origin, y.joint.origin, atol=LENGTH)
            and np.allclose(x.joint.axis, y.joint.axis, atol=ANGLE)
            and np.allclose(x.joint.range, y.joint.range, rtol=SHARE)
        )
        if not same:
            return f"the joint of {x.name} differs"
        if (x.handle is None, x.cavity is None) != (y.handle is None, y.cavity is None):
            return f"the handle or the cavity of {x.name} differs"
    return ""


def _masses(a: Asset, b: Asset) -> str:
    one, other = (mujoco.MjModel.from_xml_path(str(x.model_path)).body_mass for x in (a, b))
    same = one.shape == other.shape and np.allclose(one, other, rtol=2 * SHARE)
    return "" if same else "masses differ"


def _geometry(one: Path, other: Path) -> str:
    names = [{p.name for p in (x / "meshes").glob("*visual*.obj")} for x in (one, other)]
    if names[0] != names[1]:
        return "visual meshes differ in number"
    for name in sorted(names[0]):
        a, b = (_points(x / "meshes" / name) for x in (one, other))
        gap = max(cKDTree(a).query(b)[0].max(), cKDTree(b).query(a)[0].max())
        if gap > LENGTH:
            return f"{name} differs by {1000 * gap:.1f} mm"
    return ""


def _points(path: Path) -> np.ndarray:
    mesh = trimesh.load(path, force="mesh", process=False, skip_materials=True)
    assert isinstance(mesh, trimesh.Trimesh)
    return np.vstack([mesh.vertices[np.unique(mesh.faces)], mesh.triangles_center])


def _textures(one: Path, other: Path) -> str:
    names = [{p.name for p in (x / "meshes").glob("*.png")} for x in (one, other)]
    if names[0] != names[1]:
        return "textures differ in number"
    for name in sorted(names[0]):
        a, b = (np.asarray(Image.open(x / "meshes" / name), float) for x in (one, other))
        if a.shape != b.shape or np.abs(a - b).mean() > GREY_LEVELS:
            return f"colours of {name} differ"
    return ""
