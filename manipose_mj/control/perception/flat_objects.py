"""Objects of a category that is round in the catalogue, but which are not: a flat bottle, an oval can.

The category's network finds their axis and nothing about it. Where no round shape fits what is seen, the smallest
rectangle around the points, as they are seen along the axis, says where their sides are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from manipose_mj.control.perception.objects.completed_shape import in_front, stable_rests
from manipose_mj.control.perception.objects.estimated_symmetry import estimated_symmetry
from manipose_mj.control.perception.objects.known_shapes import KnownShape, best_fit, known_shapes
from manipose_mj.control.perception.objects.object_kinds import ObjectKind
from manipose_mj.control.perception.objects.object_views import ObjectView, seen_points
from manipose_mj.control.perception.pose_sensing import SensedPose
from manipose_mj.poses import SymmetryGroup, compose, invert, rotation_about, transform

# Of round test objects only bins fit worse, and their rectangles are nearly squares.
_ROUND = 0.005  # misfit up to which what is seen is round [m]
_VIEWS = 2  # cameras; one sees of what is round a side that is less deep than wide
_FLAT = 0.85  # of its length, a rectangle's width from which on it is none
_AS_WELL = 1.05  # times the misfit of the round shape, up to which something flat is believed
_ANGLES = 45  # of a quarter turn
_EDGES = (1.0, 99.0)  # percentiles between which the points lie: a few are noise
_X = np.array([1.0, 0.0, 0.0])
_HALF_TURN = SymmetryGroup(np.stack([np.eye(3), np.diag([1.0, -1.0, -1.0])]))


def sensed_if_flat(kind: ObjectKind, sensed: SensedPose, views: Sequence[ObjectView]) -> SensedPose:
    """`sensed`, or the pose and shape of something flat where that fits what is seen as well.

    Args:
      kind: Of the object; only round ones of the catalogue are looked at again.
      sensed: By the category's network, as something round.
      views: That it was sensed in.
    """
    if not (kind.in_catalogue and kind.object_type == "axial") or sensed.misfit <= _ROUND:
        return sensed
    if len(views) < _VIEWS:
        return sensed
    points = seen_points(views)
    about, lengths = _rectangle(transform(invert(sensed.pose), points)[:, 1:])
    if lengths[1] > _FLAT * lengths[0]:
        return sensed
    pose = sensed.pose @ about
    local = transform(invert(pose), points)
    extents = np.maximum(np.append(sensed.shape.extents[0], lengths), 1e-3)
    flat = [_flat(shape) for shape in known_shapes(kind.category)]
    shape, misfit = best_fit(flat, extents, local)
    if misfit > _AS_WELL * sensed.misfit:
        return sensed
    return replace(sensed, pose=pose, shape=_symmetric(shape, local, pose, views), misfit=misfit)


def _rectangle(
    across: Float[np.ndarray, "n 2"],
) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "2"]]:
    """The smallest rectangle about points of the YZ plane: `T_axis_label` [m], and its lengths, the longer along Y."""
    found = []
    for angle in np.linspace(0, np.pi / 2, _ANGLES, endpoint=False):
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        low, high = np.percentile(across @ turn.T, _EDGES, axis=0)
        found.append((float(np.prod(high - low)), angle, turn.T @ (low + high) / 2, high - low))
    _, angle, middle, lengths = min(found, key=lambda each: each[0])
    if lengths[0] < lengths[1]:
        angle, lengths = angle + np.pi / 2, lengths[::-1]
    return compose(rotation_about(_X, angle), np.append(0.0, middle)), lengths


def _symmetric(
    shape: KnownShape,
    points: Float[np.ndarray, "n 3"],
    pose: Float[np.ndarray, "4 4"],
    views: Sequence[ObjectView],
) -> KnownShape:
    """The shape with a half turn about X as its symmetry, if the points show none against it."""
    group = estimated_symmetry(
        "mirror",
        points,
        shape.surface,
        shape.label.center,
        lambda moved: in_front(transform(pose, moved), views),
    )
    turned = any(np.allclose(turn, _HALF_TURN.rotations[1]) for turn in group.rotations)
    symmetry = _HALF_TURN if turned else SymmetryGroup.identity()
    corners = np.concatenate(shape.hulls)
    rests = stable_rests(corners, shape.mass.center_of_mass)
    return replace(shape, label=replace(shape.label, symmetry=symmetry), rests=rests)


def _flat(shape: KnownShape) -> KnownShape:
    """A round shape as one that is not round."""
    return replace(shape, label=replace(shape.label, object_type="mirror", symmetry=_HALF_TURN))
