"""Flat objects of categories that are round in the catalogue: their sides are found, and what is round stays so."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.control.perception.flat_objects import sensed_if_flat
from manipose_mj.control.perception.objects.known_shapes import known_shapes
from manipose_mj.control.perception.objects.object_kinds import ObjectKind
from manipose_mj.control.perception.objects.object_views import ObjectView, ViewImage
from manipose_mj.control.perception.pose_sensing import SensedPose
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import compose, pose_error, rotation_about

CAN = ObjectKind("can", "axial", True)
X = np.array([1.0, 0.0, 0.0])


def a_view(points: np.ndarray) -> ObjectView:
    """Points in the world frame, seen from its origin by a camera that measured no depth beside them."""
    image = ViewImage(
        np.zeros((24, 32)),
        np.zeros((24, 32), bool),
        Intrinsics(32, 24, 30.0, 30.0, 16.0, 12.0),
        lambda: np.zeros((24, 32, 3), np.uint8),
    )
    points = points.astype(np.float32)
    return ObjectView("front", np.eye(4), points, np.zeros_like(points), image)


def sensed_can(flatness: float) -> tuple[SensedPose, np.ndarray, ObjectView]:
    """A can, so much flatter along Z than along Y, taken for a round one that is turned and beside it; and its pose."""
    shape = known_shapes("can")[0]
    truth = compose(rotation_about(X, 0.6), np.array([0.3, 0.1, 0.5]))
    noise = np.random.default_rng(0).normal(0, 0.002, shape.surface.shape)
    points = (shape.surface * [1.0, 1.0, flatness] + noise) @ truth[:3, :3].T + truth[:3, 3]
    guess = truth @ compose(rotation_about(X, -1.1), np.array([0.0, 0.006, -0.004]))
    sensed = SensedPose(guess, shape, 0.004 + 0.004 * (flatness < 1), 0.9, "front")
    return sensed, truth, a_view(points)


def test_a_flat_can_is_turned_as_its_sides_are():
    sensed, truth, view = sensed_can(0.6)
    found = sensed_if_flat(CAN, sensed, (view, view))
    label = found.shape.label
    assert label.object_type == "mirror" and not label.symmetry.axial
    assert len(label.symmetry.rotations) == 2, "half a turn about its axis changes nothing"
    shift, turn = pose_error(found.pose, truth, label.symmetry)
    assert shift < 0.003 and turn < np.deg2rad(5)
    assert label.extents[2] / label.extents[1] == pytest.approx(0.6, abs=0.05)
    assert found.misfit < sensed.misfit


@pytest.mark.parametrize(
    "kind", [CAN, ObjectKind("mug", "mirror", True), ObjectKind("tin", "axial", False)]
)
def test_what_is_round_or_no_round_category_of_the_catalogue_stays(kind):
    sensed, _, view = sensed_can(1.0 if kind is CAN else 0.6)
    assert sensed_if_flat(kind, sensed, (view, view)) is sensed


def test_by_one_camera_nothing_is_told_to_be_flat():
    sensed, _, view = sensed_can(0.6)
    assert sensed_if_flat(CAN, sensed, (view,)) is sensed
