"""Grasps touch, fit, stay clear and hold; geometry is checked against MuJoCo's own distances."""

import time

import mujoco
import numpy as np
import pytest
import trimesh

from asset_pipeline.geometry.mass import shape_mass_properties
from asset_pipeline.geometry.stable_poses import stable_poses
from manipose_mj.assets.franka_hand import FINGER_BOXES, FINGER_OFFSET, PAD_BOX, TCP_OFFSET
from manipose_mj.assets.geometry import Body, Shape
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.assets.label import PoseLabel
from manipose_mj.grasp_sampling.sampler import sample_grasps
from manipose_mj.mjcf.panda.geometry import BOXES, CAPSULES
from manipose_mj.mjcf.panda.kinematics import FLANGE_OFFSET, HAND_YAW
from manipose_mj.poses import SymmetryGroup, compose, rotation_about, rotation_to_quaternion

GRIPPER = ParallelJaw()
WALL, RING_RADIUS, RING_HEIGHT = 0.004, 0.045, 0.10


def _body(*shapes):
    return Body("thing", shapes, shapes, shape_mass_properties(shapes, 300.0))


def _ring():
    """A mug without a handle, too wide to be grasped across: 24 wall segments and a bottom."""
    shapes = [
        Shape("cylinder", (RING_RADIUS - WALL, 0.002), compose(np.eye(3), np.array([0, 0, 0.002])))
    ]
    for k in range(24):
        corners = [
            (r * np.cos(a), r * np.sin(a), z)
            for a in (2 * np.pi * k / 24, 2 * np.pi * (k + 1) / 24)
            for r in (RING_RADIUS - WALL, RING_RADIUS)
            for z in (0.0, RING_HEIGHT)
        ]
        shapes.append(Shape("mesh", mesh=trimesh.convex.convex_hull(np.array(corners))))
    return _body(*shapes)


def _label(body, symmetry):
    upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # X is the frame's z
    extents = np.ptp(body.surface().bounds, axis=0)
    return PoseLabel(np.zeros(3), upright, "axial", upright.T @ extents, symmetry)


BODIES = {
    "box": _body(Shape("box", (0.02, 0.03, 0.06))),
    "can": _body(Shape("cylinder", (0.033, 0.06))),
    "ring": _ring(),
}


@pytest.fixture(scope="module")
def sampled():
    """Name -> body, stable poses, grasps."""
    found = {}
    for name, body in BODIES.items():
        touching = trimesh.util.concatenate([s.surface(96) for s in body.collision])
        label = _label(body, SymmetryGroup.identity() if name == "box" else SymmetryGroup.about_x())
        poses = stable_poses(touching, body.mass_properties.center_of_mass, label=label)
        found[name] = body, poses, sample_grasps(body, poses)
    return found


@pytest.mark.parametrize("name", BODIES)
def test_frames_and_counts(sampled, name):
    _, poses, grasps = sampled[name]
    assert 150 <= len(grasps) <= 200 and grasps.clear.shape == (len(grasps), len(poses))
    rotation = grasps.poses[:, :3, :3]
    np.testing.assert_allclose(
        rotation @ rotation.transpose(0, 2, 1), np.tile(np.eye(3), (len(grasps), 1, 1)), atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.det(rotation), 1)
    assert (grasps.widths > 0.001).all() and (grasps.widths <= 0.077).all()


@pytest.mark.parametrize("name", BODIES)
def test_pads_touch_opposite_faces_and_the_width_is_right(sampled, name):
    """A pad 1 mm inside the stated width reaches into the body, 1.5 mm outside it is free."""
    body, _, grasps = sampled[name]
    index = np.arange(0, len(grasps), 7)
    scene = _Scene(body)
    for k in index:
        pose, width = grasps.poses[k], float(grasps.widths[k])
        wider = scene.pad_distances(pose, width + 0.003)
        closer = scene.pad_distances(pose, width - 0.002)
        assert wider.min() > 0, (k, wider)
        assert wider.max() < 0.003, (k, wider)  # both pads are near, not just one
        assert closer.max() < 0, (k, closer)


@pytest.mark.parametrize("name", BODIES)
def test_the_gripper_is_free_on_the_way_in(sampled, name):
    body, _, grasps = sampled[name]
    scene = _Scene(body)
    for k in range(0, len(grasps), 6):
        pose, width = grasps.poses[k], grasps.widths[k]
        for back in (0.0, 0.03, 0.06, 0.10):
            away = pose @ compose(np.eye(3), np.array([0.0, 0.0, -back]))
            assert scene.hand_distance(away, float(GRIPPER.opening(width))) > 0, (k, back)


@pytest.mark.parametrize("name", BODIES)
def test_clear_is_what_the_boxes_corners_say(sampled, name):
    _, poses, grasps = sampled[name]
    assert grasps.clear.any(axis=0).sum() >= 2
    for k in range(0, len(grasps), 5):
        boxes = GRIPPER.boxes(GRIPPER.opening(grasps.widths[k : k + 1]))[0]
        corners = np.array(
            [[x, y, z] for b in boxes for x in b[:, 0] for y in b[:, 1] for z in b[:, 2]]
        )
        corners = np.concatenate([corners, corners - [0, 0, 0.10]])
        in_object = corners @ grasps.poses[k][:3, :3].T + grasps.poses[k][:3, 3]
        for s, rest in enumerate(poses):
            lowest = (in_object @ rest.rotation[2]).min() + rest.height
            assert grasps.clear[k, s] == (lowest >= 0.003), (k, s, lowest)


def test_grasps_serve_pairs_of_stable_poses(sampled):
    _, poses, grasps = sampled["can"]
    assert len(poses) == 3
    for i in range(3):
        for j in range(i):
            assert (grasps.clear[:, i] & grasps.clear[:, j]).sum() >= 20, (i, j)


def test_an_upright_can_is_held_from_the_side_at_many_heights(sampled):
    _, poses, grasps = sampled["can"]
    up = next(s for s, p in enumerate(poses) if p.rotation[2, 2] > 0.9)
    mine = grasps.poses[grasps.clear[:, up]]
    tilt = np.degrees(np.arcsin(np.clip(-mine[:, 2, 2], -1, 1)))  # approach below level
    side = mine[np.abs(tilt) < 50]
    assert len(side) > 50 and np.ptp(side[:, 2, 3]) > 0.05
    assert len(np.unique(np.round(tilt[np.abs(tilt) < 50] / 5))) >= 4
    azimuth = np.arctan2(side[:, 1, 2], side[:, 0, 2])
    assert len(np.unique(np.floor(azimuth / (np.pi / 4)))) == 8


def test_a_lying_can_is_held_from_above(sampled):
    _, poses, grasps = sampled["can"]
    lying = next(s for s, p in enumerate(poses) if abs(p.rotation[2, 2]) < 0.1)
    up = poses[lying].rotation[2]
    straight = grasps.poses[grasps.clear[:, lying]][:, :3, 2] @ up
    assert (straight < -0.94).sum() >= 20 and (straight < -0.99).sum() >= 4


def test_a_wide_mug_is_held_by_its_wall(sampled):
    body, poses, grasps = sampled["ring"]
    assert (grasps.widths < 0.012).mean() > 0.9
    upright = next(s for s, p in enumerate(poses) if p.rotation[2, 2] > 0.9)
    mine = grasps.clear[:, upright]
    assert mine.sum() > 50
    half = (grasps.widths / 2 + 0.005)[:, None] * grasps.poses[:, :3, 1]
    radii = [
        np.linalg.norm((grasps.poses[:, :3, 3] + s * half)[mine][:, :2], axis=1) for s in (-1, 1)
    ]
    inner, outer = np.minimum(*radii), np.maximum(*radii)
    assert (inner < RING_RADIUS - WALL).all() and (outer > RING_RADIUS * np.cos(np.pi / 24)).all()


def test_same_every_time():
    body = BODIES["box"]
    poses = stable_poses(body.surface(), np.zeros(3))
    a, b = sample_grasps(body, poses), sample_grasps(body, poses)
    np.testing.assert_array_equal(a.poses, b.poses)
    other = sample_grasps(body, poses, seed=1)
    assert len(other) != len(a) or not np.array_equal(other.poses, a.poses)


def test_what_is_too_wide_has_none():
    body = _body(Shape("sphere", (0.05,)))
    poses = stable_poses(Shape("box", (0.05, 0.05, 0.05)).surface(), np.zeros(3))
    grasps = sample_grasps(body, poses)
    assert len(grasps) == 0 and grasps.poses.shape == (0, 4, 4)
    assert grasps.clear.shape == (0, len(poses))


def test_time():
    """About 0.2 s on one idle core; the bound allows for a busy machine."""
    body = BODIES["can"]
    start = time.process_time()
    sample_grasps(body, stable_poses(body.surface(), np.zeros(3))[:3])
    assert time.process_time() - start < 0.8


def test_gripper_covers_the_pandas_hand():
    """Hand, fingers and the wrist that carries them lie within the boxes, both ways round."""
    shift = np.array([0, 0, TCP_OFFSET])
    own = GRIPPER.boxes(np.array([0.0]))[0]
    fingers = np.array([*FINGER_BOXES, PAD_BOX]) + [0, 0, FINGER_OFFSET] - shift
    hand = np.array(BOXES["hand"]) - shift
    for box in [*fingers, *hand, *np.sort(hand * [1, -1, 1], axis=1)]:
        inside = (own[:, 0] <= box[0] + 1e-9) & (own[:, 1] >= box[1] - 1e-9)
        assert inside.all(axis=1).any(), box
    rng = np.random.default_rng(0)
    turn = rotation_about(np.array([0.0, 0.0, 1.0]), HAND_YAW)
    for ends, radius in CAPSULES["link7"]:
        a, b = np.reshape(ends, (2, 3))
        out = rng.normal(size=(2000, 3))
        points = (
            a
            + rng.random((2000, 1)) * (b - a)
            + radius * out / np.linalg.norm(out, axis=1)[:, None]
        )
        points = (points - [0, 0, FLANGE_OFFSET]) @ turn - shift
        inside = (points[:, None] >= own[:, 0] - 1e-4) & (points[:, None] <= own[:, 1] + 1e-4)
        assert inside.all(axis=2).any(axis=1).all()


class _Scene:
    """A body's collision shapes and boxes for the hand, for MuJoCo's exact distances."""

    def __init__(self, body):
        spec = mujoco.MjSpec()
        obj = spec.worldbody.add_body(name="thing")
        for i, shape in enumerate(body.collision):
            if shape.kind == "mesh":
                spec.add_mesh(name=f"m{i}", uservert=np.asarray(shape.mesh.vertices).ravel())
                obj.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"m{i}")
            else:
                kind = getattr(mujoco.mjtGeom, f"mjGEOM_{shape.kind.upper()}")
                size = np.resize([*shape.size, 0.0, 0.0], 3)
                quat = rotation_to_quaternion(shape.pose[:3, :3])
                obj.add_geom(type=kind, size=size, pos=shape.pose[:3, 3], quat=quat)
        self._shapes = len(body.collision)
        boxes = GRIPPER.boxes(np.array([0.0]))[0]
        for box in boxes:
            mocap = spec.worldbody.add_body(mocap=True)
            mocap.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(box[1] - box[0]) / 2)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._fingers = len(GRIPPER.finger)

    def _distances(self, pose, opening, boxes):
        placed = GRIPPER.boxes(np.array([opening]))[0]
        for i, box in enumerate(placed):
            self._data.mocap_pos[i] = pose[:3, :3] @ box.mean(axis=0) + pose[:3, 3]
            self._data.mocap_quat[i] = rotation_to_quaternion(pose[:3, :3])
        mujoco.mj_kinematics(self._model, self._data)
        return np.array(
            [
                min(
                    mujoco.mj_geomDistance(self._model, self._data, self._shapes + i, k, 0.02, None)
                    for k in range(self._shapes)
                )
                for i in boxes
            ]
        )

    def pad_distances(self, pose, opening):
        """Of the left and the right pad's box from the body [m]."""
        return self._distances(pose, opening, [0, self._fingers])

    def hand_distance(self, pose, opening):
        """Of the whole hand from the body [m]."""
        return self._distances(pose, opening, range(2 * self._fingers + len(GRIPPER.hand))).min()
