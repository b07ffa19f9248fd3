"""Rest poses of a can, a box and a bowl; those that MuJoCo topples are dropped."""

import numpy as np
import pytest
import trimesh

from asset_pipeline.build.scratch_model import scratch_model
from asset_pipeline.geometry.mass import shape_mass_properties
from asset_pipeline.geometry.stable_poses import stable_poses, tilt, verified
from asset_pipeline.procedural.axial import bowl
from manipose_mj.assets.asset import StablePose
from manipose_mj.assets.geometry import Body, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, rotation_about

RADIUS, HALF = 0.033, 0.06
CAN = Shape("cylinder", (RADIUS, HALF))
# X is up: the frame's z.
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
CAN_LABEL = PoseLabel(
    np.zeros(3), UPRIGHT, "axial", np.array([0.12, 0.066, 0.066]), SymmetryGroup.about_x()
)


def _body(*shapes):
    return Body("thing", shapes, shapes, shape_mass_properties(shapes, 500.0))


def _verified(poses, body, label=None):
    with scratch_model(body) as path:
        return verified(poses, path, label=label)


def test_can_stands_lies_or_stands_on_its_lid():
    poses = stable_poses(CAN.surface(sections=96), np.zeros(3), label=CAN_LABEL)
    assert len(poses) == 3
    lying, *standing = poses
    assert abs(lying.rotation[2, 2]) < 0.05 and lying.height == pytest.approx(RADIUS, abs=1e-4)
    assert sorted(round(p.rotation[2, 2]) for p in standing) == [-1, 1]
    # The end's share of the directions seen from the middle.
    share = (1 - HALF / np.hypot(HALF, RADIUS)) / 2
    for pose in standing:
        assert pose.height == pytest.approx(HALF, abs=1e-6)
        assert pose.probability == pytest.approx(share, rel=0.02)
    assert sum(p.probability for p in poses) == pytest.approx(1)


def test_a_low_centre_of_mass_favours_standing_on_it():
    poses = stable_poses(CAN.surface(), np.array([0, 0, -0.04]), label=CAN_LABEL)
    by_up = {round(p.rotation[2, 2]): p.probability for p in poses}
    assert by_up[1] > 5 * by_up.get(-1, 0)


def test_box_rests_on_three_kinds_of_side():
    half = np.array([0.05, 0.03, 0.02])
    label = PoseLabel(np.zeros(3), np.eye(3), "mirror", 2 * half, SymmetryGroup.three_planes())
    surface = Shape("box", tuple(half)).surface()
    poses = stable_poses(surface, np.zeros(3), label=label)
    assert len(poses) == 3
    for pose in poses:
        axis = int(np.argmax(np.abs(pose.rotation[2])))
        a, b = np.delete(half, axis)
        d = half[axis]
        solid_angle = 4 * np.arctan(a * b / (d * np.sqrt(a * a + b * b + d * d)))
        assert pose.height == pytest.approx(d)
        assert pose.probability == pytest.approx(2 * solid_angle / (4 * np.pi), rel=1e-3)
    assert len(stable_poses(surface, np.zeros(3))) == 6  # nobody said which are alike


def test_bowl_stands_upright_or_upside_down():
    specimen = bowl.generate(0)
    body = specimen.bodies[0]
    touching = trimesh.util.concatenate([s.surface() for s in body.collision])
    poses = stable_poses(touching, body.mass_properties.center_of_mass, label=specimen.label)
    stand = _verified(poses, body, label=specimen.label)
    ups = [float(p.rotation[2, 2]) for p in stand]
    assert max(ups) > 0.99 and min(ups) < -0.99 and len(stand) <= 4
    assert sum(p.probability for p in stand) == pytest.approx(1)
    for pose in stand:
        lowest = (touching.vertices @ pose.rotation[2]).min() + pose.height
        assert lowest == pytest.approx(0, abs=1e-6)
        assert np.linalg.det(pose.rotation) == pytest.approx(1)


def test_a_pose_that_topples_is_dropped():
    body = _body(Shape("box", (0.02, 0.02, 0.06)))
    stands = StablePose(np.eye(3), 0.06, 0.5)
    edge = rotation_about(np.array([0.0, 1.0, 0.0]), 0.6)
    topples = StablePose(edge, 0.08, 0.5)
    kept = _verified([topples, stands], body)
    assert len(kept) == 1 and kept[0].rotation is stands.rotation
    assert kept[0].probability == 1
    with pytest.raises(InputError, match="topples from every one"):
        _verified([topples], body)


def test_a_pose_that_topples_slowly_is_dropped():
    """Set down a degree beyond its balance it hardly stirs at first."""
    body = _body(Shape("box", (0.02, 0.02, 0.06)))
    angle = np.arctan2(0.02, 0.06) + np.deg2rad(1.0)
    edge = rotation_about(np.array([0.0, 1.0, 0.0]), angle)
    height = 0.02 * np.sin(angle) + 0.06 * np.cos(angle)
    stands, wavers = StablePose(np.eye(3), 0.06, 0.5), StablePose(edge, height, 0.5)
    (kept,) = _verified([wavers, stands], body)
    assert kept.rotation is stands.rotation


def test_tilt_leaves_symmetries_out():
    down = np.diag([1.0, -1.0, -1.0])
    about_vertical = rotation_about(np.array([0.0, 0.0, 1.0]), 1.0)
    assert tilt(np.eye(3), about_vertical, None) == pytest.approx(0, abs=1e-9)
    assert tilt(np.eye(3), down, None) == pytest.approx(np.pi)
    assert tilt(np.eye(3), down, CAN_LABEL) == pytest.approx(np.pi)
    rolled = UPRIGHT @ rotation_about(np.array([1.0, 0.0, 0.0]), 2.0) @ UPRIGHT.T
    lying = rotation_about(np.array([0.0, 1.0, 0.0]), np.pi / 2)
    assert tilt(lying, lying @ rolled, None) > 1
    assert tilt(lying, lying @ rolled, CAN_LABEL) == pytest.approx(0, abs=1e-9)


def test_same_every_time():
    a, b = (stable_poses(CAN.surface(), np.zeros(3), label=CAN_LABEL) for _ in range(2))
    for first, second in zip(a, b, strict=True):
        np.testing.assert_array_equal(first.rotation, second.rotation)


def test_bad_input():
    with pytest.raises(InputError, match="outside"):
        stable_poses(CAN.surface(), np.array([0.0, 0.0, 0.1]))
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(InputError, match="convex hull"):
        stable_poses(flat, np.zeros(3))
