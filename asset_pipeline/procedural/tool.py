"""Functional tools put together from pieces: the label and the areas that follow from their grip axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, cast

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.labelling.tool_axes import functional_rotation
from asset_pipeline.procedural.pieces import ROLLING, AreaBox, Piece, rigid_specimen
from asset_pipeline.procedural.specimen import Specimen
from manipose_mj.poses import SymmetryGroup

X_AXIS = np.array([1.0, 0.0, 0.0])
NORMALS = {"y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}


def tool_specimen(
    name: str,
    pieces: Sequence[Piece],
    *,
    joint: tuple[float, float, float],
    mirror_normal: Literal["y", "z"],
    symmetry: SymmetryGroup | None = None,
    grip: tuple[float, float] | None = None,
    functional: tuple[float, float] | None = None,
    friction: tuple[float, float, float] = ROLLING,
) -> Specimen:
    """A tool whose grip axis is parallel to the generator's x, from grip to functional area.

    Its label's axes follow from the shape by our rule (`functional_rotation`).

    Args:
      name: Of the body.
      pieces: In the generator's frame, z up.
      joint: `(3,)` [m], the label's origin: on the grip axis, where the cross-section leaves the
        grip's.
      mirror_normal: Which of the generator's axes is the normal of its mirror plane.
      symmetry: In the label frame; None for the identity alone. Where the shape reaches equally far
        to both sides, half a turn about X must be in it.
      grip: From where to where along x it is held [m]; None for all before the joint.
      functional: From where to where along x it does its work [m]; None for all after the joint.
      friction: MuJoCo's sliding, torsional and rolling friction.
    """
    surface = cast(
        trimesh.Trimesh,
        trimesh.util.concatenate([s.surface() for piece in pieces for s in piece.visual]),
    )
    points = np.asarray(surface.vertices)
    low, high = float(points[:, 0].min()), float(points[:, 0].max())
    rotation = functional_rotation(points, np.array(joint), X_AXIS, NORMALS[mirror_normal])
    areas = (
        AreaBox("grip", *_stretch(surface, *(grip or (low, joint[0])))),
        AreaBox("functional", *_stretch(surface, *(functional or (joint[0], high)))),
    )
    return rigid_specimen(
        name,
        pieces,
        object_type="functional",
        symmetry=symmetry or SymmetryGroup.identity(),
        rotation=np.round(rotation) + 0.0,
        origin=np.array(joint),
        areas=areas,
        friction=friction,
    )


def _stretch(
    surface: trimesh.Trimesh, start: float, stop: float
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Corners of the bounding box of what lies between two planes across x."""
    points = np.asarray(surface.vertices)
    inside = [points[(points[:, 0] >= start) & (points[:, 0] <= stop)]]
    first, second = points[surface.edges_unique].transpose(1, 0, 2)
    for cut in (start, stop):
        crossing = (first[:, 0] - cut) * (second[:, 0] - cut) < 0
        a, b = first[crossing], second[crossing]
        inside.append(a + (b - a) * ((cut - a[:, :1]) / (b - a)[:, :1]))
    corners = np.concatenate(inside)
    return corners.min(axis=0), corners.max(axis=0)
