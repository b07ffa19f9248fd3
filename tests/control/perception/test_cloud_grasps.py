"""Grasps from clouds: the surface lies where the cloud does, and hands come from above however an object lies."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from manipose_mj.assets.asset import GraspSet, StablePose
from manipose_mj.assets.geometry import MassProperties
from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.perception.cloud_grasps import cloud_grasps
from manipose_mj.control.perception.grasp_sources import resting, sensed_grasps
from manipose_mj.control.perception.objects.known_shapes import KnownShape
from manipose_mj.control.perception.objects.object_views import ObjectView
from manipose_mj.control.perception.observed_surface import completed, observed_surface
from manipose_mj.control.perception.pose_sensing import SensedPose
from manipose_mj.control.perception.source_names import GRASP_SOURCES
from manipose_mj.poses import SymmetryGroup, rotation_about

X = np.array([1.0, 0.0, 0.0])
LENGTH = 0.16


def prism(
    width: float, height: float, object_type="functional", axial=False, rounded=False
) -> KnownShape:
    """A bar along X that rests on its broad sides, or a round one."""
    y, z = width / 2, height / 2
    section = [(y, z), (y, -z), (-y, z), (-y, -z)]
    if axial or rounded:
        angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
        section = [(y * np.cos(a), y * np.sin(a)) for a in angles]
    hull = np.array([(x, *yz) for x in (-LENGTH / 2, LENGTH / 2) for yz in section])
    symmetry = SymmetryGroup(np.eye(3)[None], axial=axial)
    extents = np.array([LENGTH, width, height])
    label = PoseLabel(np.zeros(3), np.eye(3), object_type, extents, symmetry)
    rests = (StablePose(np.eye(3), z, 0.5), StablePose(rotation_about(X, np.pi), z, 0.5))
    mass = MassProperties(0.02, np.zeros(3), 1e-5 * np.eye(3))
    surface = np.random.default_rng(0).uniform(-1, 1, (300, 3)) * extents / 2
    return KnownShape("bar", label, (hull,), surface, rests, mass)


def seen_bar(width: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Noisy points of the upper side of a round bar of this width, and their normals."""
    angle = rng.uniform(0.2, np.pi - 0.2, 900)
    normals = np.stack([np.zeros_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    along = rng.uniform(-LENGTH / 2, LENGTH / 2, 900)[:, None] * X
    radius = width / 2 + rng.normal(0, 0.001, (900, 1))
    return along + radius * normals, normals


def test_what_is_round_is_revolved_and_what_has_a_plane_is_mirrored():
    point, normal = np.array([[0.01, 0.02, 0.005]]), np.array([[0.0, 0.0, 1.0]])
    label = prism(0.04, 0.04, "axial", axial=True).label
    points, normals = completed(point, normal, label)
    assert len(points) == 24
    np.testing.assert_allclose(np.hypot(*points[:, 1:].T), np.hypot(0.02, 0.005))
    assert np.allclose(np.einsum("ni,ni->n", points, normals), 0.005)
    points, normals = completed(point, normal, prism(0.04, 0.02, "mirror").label)
    np.testing.assert_allclose(points, [[0.01, 0.02, 0.005], [0.01, 0.02, -0.005]])
    np.testing.assert_allclose(normals[1], [0, 0, -1])


def test_the_surface_lies_where_the_cloud_does_on_the_hidden_side_too():
    points, normals = seen_bar(0.050, np.random.default_rng(0))
    shape = prism(0.044, 0.044, "axial", axial=True)  # fitted 3 mm too thin
    cloud = observed_surface(points, normals, shape)
    side = np.abs(cloud.touch.points[:, 0]) < 0.45 * LENGTH
    radius = np.hypot(*cloud.touch.points[side, 1:].T)
    assert np.median(radius) == pytest.approx(0.025, abs=0.0005)
    assert np.percentile(radius, 5) > 0.0235
    nothing = observed_surface(points[:2], normals[:2], prism(0.044, 0.044, rounded=True))
    assert np.hypot(*nothing.touch.points[:, 1:].T).max() < 0.0225, "two points tell nothing"


def test_what_the_fitted_shape_lacks_is_in_the_way():
    points, normals = seen_bar(0.02, np.random.default_rng(0))
    clip = np.array([[0.05, 0.0, 0.03]])
    cloud = observed_surface(np.r_[points, clip], np.r_[normals, [[0, 0, 1]]], prism(0.02, 0.02))
    assert np.linalg.norm(cloud.obstacles - clip, axis=1).min() < 1e-6


@pytest.mark.sample(1)
@pytest.mark.parametrize("angle", [0.0, 0.6, 1.2])
def test_a_bar_is_taken_from_above_however_it_lies(angle):
    shape = prism(0.02, 0.02, rounded=True)  # its label knows no turn about X
    points, normals = seen_bar(0.022, np.random.default_rng(0))
    cloud = observed_surface(points, normals, shape)
    start = resting(shape, rotation_about(X, angle))
    goal = resting(shape, rotation_about(X, angle + 1.2))
    grasps = cloud_grasps(cloud, [start, goal], shape.rests)
    assert grasps.clear.shape == (len(grasps), 2)
    up = [pose.rotation[2] for pose in (start, goal)]
    down = np.array([[-tcp[:3, 2] @ each for each in up] for tcp in grasps.poses])
    assert ((down > 0.99).sum(axis=0) >= 10).all(), "few from above"
    assert (down.min(axis=1) > 0.75).sum() >= 5, "none serves both"
    assert len(grasps) <= 200 and (grasps.widths < 0.03).all()


def test_what_only_a_neck_is_narrow_of_is_taken_from_aslant_too():
    slab, neck = prism(0.1, 0.03), prism(0.06, 0.016).hulls[0] * [0.1, 1, 1] + 0.088 * X
    shape = replace(slab, hulls=(*slab.hulls, neck), rests=slab.rests[:1])
    nothing = np.empty((0, 3))
    lying = resting(shape, np.eye(3))
    grasps = cloud_grasps(observed_surface(nothing, nothing, shape), [lying], [lying])
    down = -grasps.poses[grasps.clear[:, 0], 2, 2]
    assert (down > 0.99).any() and ((down < 0.9).sum() >= 4), "none comes tilted"


def view(points: np.ndarray, normals: np.ndarray) -> ObjectView:
    nothing: Any = None
    pose = np.eye(4)
    return ObjectView("front", pose, points.astype(np.float32), normals.astype(np.float32), nothing)


def test_every_source_gives_grasps_for_the_rests_of_the_fitted_shape():
    shape = prism(0.02, 0.02, rounded=True)
    sensed = SensedPose(np.eye(4), shape, 0.001, 0.95, "front")
    views = (view(*seen_bar(0.022, np.random.default_rng(0))),)
    own = GraspSet(np.tile(np.eye(4), (3, 1, 1)), np.full(3, 0.02), np.ones((3, 5), bool))
    label = replace(shape.label, origin=np.array([0.0, 0.0, 0.1]))
    asset: Any = SimpleNamespace(grasps=own, label=label)
    for source in GRASP_SOURCES:
        grasps = sensed_grasps(source, sensed, views, (), lambda: asset)
        assert len(grasps) and grasps.clear.shape == (len(grasps), 2), source
        if source == "annotated":
            np.testing.assert_allclose(grasps.poses[:, 2, 3], -0.1)


def test_a_cloud_that_contradicts_itself_is_not_believed():
    shape = prism(0.02, 0.02, rounded=True)
    rng = np.random.default_rng(0)
    points, normals = seen_bar(0.022, rng)
    scattered = points + rng.normal(0, 0.03, points.shape)  # cameras that disagree by 3 cm
    sensed = SensedPose(np.eye(4), shape, 0.01, 0.95, "front")
    asset: Any = None
    views = (view(scattered, normals),)
    grasps = sensed_grasps("cloud", sensed, views, (), lambda: asset)
    assert len(grasps) >= 100
    assert len(sensed_grasps("cloud", sensed, views, (), lambda: asset, 400)) > len(grasps)
