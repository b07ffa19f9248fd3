"""Inverse kinematics of many arms, against mink; grasps that are chosen can be taken; clouds in, joint angles out."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import mink
import numpy as np
import pytest

from manipose_mj.actions.tcp_solver import TcpSolver, _arm_model
from manipose_mj.assets import catalogue
from manipose_mj.batch.perception.reaching import (
    REACHED,
    choose_grasps,
    estimate_and_choose,
    grasp_table,
    reach_poses,
)
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.kinematics import tcp_pose
from manipose_mj.mjcf.panda.robot import HOME, POSITION_LIMITS
from manipose_mj.poses import compose, rotation_about

LOW, HIGH = POSITION_LIMITS.T


def by_mink(pose: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Joint angles for a pose by mink's differential inverse kinematics within the joint limits."""
    model = _arm_model()
    configuration = mink.Configuration(model, q=np.concatenate([start, np.zeros(model.nq - 7)]))
    frame = mink.FrameTask("tcp", "site", position_cost=1.0, orientation_cost=0.3, lm_damping=1e-4)
    frame.set_target(mink.SE3.from_matrix(pose))
    limits = [mink.ConfigurationLimit(model)]
    for _ in range(60):
        velocity = mink.solve_ik(configuration, [frame], 0.5, "daqp", damping=1e-6, limits=limits)
        configuration.integrate_inplace(velocity, 0.5)
    return configuration.q[:7]


@pytest.mark.full
def test_it_agrees_with_mink():
    rng = np.random.default_rng(0)
    starts = np.stack([HOME + rng.uniform(-0.3, 0.3, 7) for _ in range(30)])
    moved = np.clip(starts + rng.uniform(-0.25, 0.25, starts.shape), LOW + 0.05, HIGH - 0.05)
    poses = np.stack([tcp_pose(q) for q in moved])
    found, error = jax.jit(reach_poses)(
        jnp.asarray(poses, jnp.float32), jnp.asarray(starts, jnp.float32)
    )
    assert float(error.max()) < 1e-4
    theirs = np.stack([by_mink(p, q) for p, q in zip(poses, starts, strict=True)])
    for ours, other in zip(np.asarray(found, float), theirs, strict=True):
        np.testing.assert_allclose(tcp_pose(ours), tcp_pose(other), atol=5e-4)
    # Seven joints for six numbers: both take the least motion, step by step.
    apart = np.abs(np.asarray(found) - theirs).max(axis=1)
    assert np.median(apart) < 0.02


@pytest.mark.full
def test_it_is_the_solver_of_the_cpu():
    rng = np.random.default_rng(1)
    solver = TcpSolver()
    starts = rng.uniform(LOW + 0.2, HIGH - 0.2, (20, 7))
    poses = np.stack([tcp_pose(rng.uniform(LOW, HIGH)) for _ in starts])
    poses[:3, :3, 3] = (3.0, 0.0, 0.2)  # out of reach
    found, error = jax.jit(reach_poses)(
        jnp.asarray(poses, jnp.float32), jnp.asarray(starts, jnp.float32)
    )
    found = np.asarray(found, float)
    assert (found >= LOW - 1e-6).all() and (found <= HIGH + 1e-6).all()
    assert (np.asarray(error)[:3] > 1.0).all() and np.isfinite(found).all()
    own = np.array([solver.reach(p, q)[1] for p, q in zip(poses, starts, strict=True)])
    np.testing.assert_array_equal(np.asarray(error)[3:] < REACHED, own[3:] < REACHED)


@pytest.fixture(scope="module")
def objects():
    return [catalogue.load_by_name(name) for name in ("box_000", "mug_000")]


def labels_on_the_table(objects, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Objects upright on the table before the robot."""
    rng = np.random.default_rng(2)
    rows = np.arange(count) % len(objects)
    labels = []
    for row in rows:
        label = objects[row].label
        place = np.array([rng.uniform(0.4, 0.55), rng.uniform(-0.2, 0.2), 0.05])
        yaw = rotation_about(np.array([0.0, 0.0, 1.0]), float(rng.uniform(-3, 3)))
        labels.append(compose(yaw @ label.rotation, place))
    return np.stack(labels), rows


@pytest.mark.full
def test_grasps_that_are_chosen_can_be_taken(objects):
    labels, rows = labels_on_the_table(objects, 12)
    table = grasp_table(objects)
    choice = jax.jit(lambda labels: choose_grasps(labels, jnp.asarray(rows), table))(
        jnp.asarray(labels, jnp.float32)
    )
    assert np.asarray(choice.found).mean() > 0.8
    for world in np.flatnonzero(choice.found):
        joints = np.asarray(choice.joints[world], float)
        np.testing.assert_allclose(tcp_pose(joints), choice.tcp[world], atol=2e-3)
        own = np.linalg.inv(labels[world]) @ np.asarray(choice.tcp[world])
        known = np.asarray(table.poses[rows[world]])[np.asarray(table.valid[rows[world]])]
        half = own @ np.diag([-1.0, -1.0, 1.0, 1.0])
        assert min(np.abs(known - p).max(axis=(1, 2)).min() for p in (own, half)) < 1e-3
        assert choice.tcp[world, 2, 2] < 0  # from above
    assert choice.actions().shape == (12, 8)


def test_objects_without_grasps_are_refused():
    with pytest.raises(InputError, match="has no grasps"):
        grasp_table([catalogue.load_by_name("cabinet_000")])


class Knows:
    """Stands in for a pose estimator: says what it was told, whatever it sees."""

    at_once = 64

    def __init__(self, poses: np.ndarray) -> None:
        self.poses = poses


@pytest.mark.full
def test_clouds_lead_to_joint_angles(objects, monkeypatch):
    labels, rows = labels_on_the_table(objects, 4)
    camera = compose(rotation_about(np.array([1.0, 0, 0]), 2.5), np.array([0.5, 0.0, 1.0]))
    cameras = np.tile(camera, (4, 1, 1)).astype(np.float32)
    seen = np.linalg.inv(camera) @ labels

    def estimates(model, points, normals, mask, *, key):
        return type("Found", (), {"poses": jnp.asarray(model.poses, jnp.float32)[:, None]})

    monkeypatch.setattr("manipose_mj.batch.perception.reaching.estimate_batch", estimates)
    cloud = jnp.zeros((4, 256, 3))
    estimator: Any = Knows(seen)
    found, choice = jax.jit(partial(estimate_and_choose, estimator))(
        cloud, cloud, jnp.ones((4, 256), bool), jnp.asarray(cameras), jnp.asarray(rows), grasp_table(objects),
        key=jax.random.key(0),
    )  # fmt: skip
    np.testing.assert_allclose(found, labels, atol=1e-5)
    expected = jax.jit(choose_grasps)(
        jnp.asarray(labels, jnp.float32), jnp.asarray(rows), grasp_table(objects)
    )
    np.testing.assert_allclose(choice.joints, expected.joints, atol=1e-2)
