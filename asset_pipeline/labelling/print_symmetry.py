"""Whether a scan's print, and not only its shape, maps onto itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float
from PIL import Image

from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.surface_symmetry import GENERIC_TURNS, PROBES
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup, rotation_about

# Mean difference of colours, per channel from 0 to 1, that light and wear explain.
SAME_COLOUR = 0.06
BLUR = 24  # neighbours over which colours are averaged: prints count, speckles do not


def surface_colours(
    cloud: SurfaceCloud, mesh: trimesh.Trimesh, texture: Path
) -> Float[np.ndarray, "n 3"] | None:
    """The texture's colour at every point of the cloud, from 0 to 1; None where the mesh has no `uv`."""
    uv = getattr(mesh.visual, "uv", None)
    if uv is None:
        return None
    corners = np.asarray(mesh.faces)[cloud.faces]
    share = trimesh.triangles.points_to_barycentric(
        np.asarray(mesh.vertices)[corners], cloud.points, method="cross"
    )
    share = np.clip(np.nan_to_num(share, nan=1 / 3), 0, 1)
    share = share / share.sum(axis=1, keepdims=True)
    at = np.einsum("nk,nkj->nj", share, np.asarray(uv)[corners])
    with Image.open(texture) as image:
        pixels = np.asarray(image.convert("RGB"), float) / 255
    height, width = pixels.shape[:2]
    column = np.clip((at[:, 0] % 1) * width, 0, width - 1).astype(int)
    row = np.clip((1 - at[:, 1] % 1) * height, 0, height - 1).astype(int)
    return pixels[row, column]


def print_symmetry(
    cloud: SurfaceCloud, colours: Float[np.ndarray, "n 3"] | None, label: PoseLabel
) -> SymmetryGroup:
    """Of the shape's symmetries those that leave its print unchanged, a group.

    Where not every turn about an axis of revolution does, half and quarter turns about it are tried.

    Args:
      cloud: The surface.
      colours: Of its points; None for a print that cannot be read, which is taken to leave alike
        nothing but the turns about an axis of revolution.
      label: With the shape's symmetry.
    """
    shape = label.symmetry
    if colours is None:
        return SymmetryGroup.about_x() if shape.axial else SymmetryGroup.identity()

    def kept(turn: np.ndarray) -> bool:
        motion = label.rotation @ turn @ label.rotation.T
        return not print_differs(cloud, colours, motion, label.origin)

    axis = np.array([1.0, 0.0, 0.0])
    tried = list(shape.rotations[1:])
    axial = bool(shape.axial) and all(kept(rotation_about(axis, t)) for t in GENERIC_TURNS)
    if shape.axial and not axial:
        tried = [np.round(rotation_about(axis, t)) for t in (np.pi / 2, np.pi)]
    members = [turn for turn in tried if kept(turn)]
    group = SymmetryGroup.generated(np.stack(members)) if members else SymmetryGroup.identity()
    return SymmetryGroup(group.rotations, axial=axial)


def print_differs(
    cloud: SurfaceCloud,
    colours: Float[np.ndarray, "n 3"],
    motion: Float[np.ndarray, "3 3"],
    center: Float[np.ndarray, "3"],
) -> bool:
    """Whether the moved surface has other colours than the surface where it comes to lie.

    Args:
      cloud: The surface, which the motion maps onto itself.
      colours: Of its points.
      motion: A rotation about `center`.
      center: `(3,)` [m], in the mesh frame.
    """
    points = cloud.points[cloud.thinned(PROBES)]
    moved = (points - center) @ motion.T + center
    here = colours[cloud.tree.query(points, BLUR)[1]].mean(axis=1)
    there = colours[cloud.tree.query(moved, BLUR)[1]].mean(axis=1)
    return float(np.abs(here - there).mean()) > SAME_COLOUR
