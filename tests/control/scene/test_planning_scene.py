"""The planner's collision queries: what is too close to what, and that asking leaves no trace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.scene.collision_model import subtree_geoms
from manipose_mj.control.scene.collision_query import (
    CONTACT,
    TRANSIT,
    AttachedObject,
    Clearance,
    CollisionQuery,
    FixedObject,
)
from manipose_mj.mjcf.panda.kinematics import (
    HOME,
    POSITION_LIMITS,
    tcp_pose,
)
from manipose_mj.poses import compose

LOW, HIGH = POSITION_LIMITS.T


def test_the_scene_knows_where_the_tcp_is(scene):
    for q in np.random.default_rng(4).uniform(0.9 * LOW, 0.9 * HIGH, (5, 7)):
        np.testing.assert_allclose(scene.tcp_pose(q), tcp_pose(q), atol=1e-6)


def test_the_hand_collides_with_the_table_when_lowered(scene, tcp_at):
    assert not scene.in_collision(HOME)
    low = tcp_at((0.45, 0.1, -0.01))
    assert scene.in_collision(low)
    first, second, distance = scene.first_collision(low)
    assert "table" in (first, second) and distance < TRANSIT.arm
    assert any(name.startswith("panda/") for name in (first, second))


def test_clearance_is_how_near_is_too_near(scene, tcp_at):
    near = tcp_at((0.45, 0.1, 0.014))  # the finger tips are 5 mm over the table
    assert scene.in_collision(near, CollisionQuery(TRANSIT))
    assert not scene.in_collision(near, CollisionQuery(CONTACT))


def _attached(environment, scene, height: float = 0.05) -> AttachedObject:
    body = environment.physics.model.ptr.body("object_0/").id
    pose_tcp = compose(np.eye(3), np.array([0.0, 0.0, height]))
    return AttachedObject(body, subtree_geoms(scene.model, body), pose_tcp)


def test_what_is_attached_collides_though_the_hand_is_free(environment, scene, tcp_at):
    query = _attached(environment, scene).query()
    high, low = tcp_at((0.45, 0.1, 0.35)), tcp_at((0.45, 0.1, 0.08))
    assert not scene.in_collision(low)
    assert scene.in_collision(low, query)
    names = scene.first_collision(low, query)[:2]
    assert any(name.startswith("object_0/") for name in names)
    assert not scene.in_collision(high, query)


def test_a_placed_object_collides_where_it_is_placed(environment, scene):
    held = _attached(environment, scene)
    free, inside = (compose(np.eye(3), np.array([0.45, 0.1, z])) for z in (0.3, 0.0))
    for place, collides in ((free, False), (inside, True)):
        query = CollisionQuery(attached=FixedObject(held.body, held.geoms, place))
        assert scene.in_collision(HOME, query) is collides


def test_a_target_may_be_touched_by_the_gripper_alone(environment, scene, tcp_at):
    geoms = _attached(environment, scene).geoms
    label = environment.task.object.label_pose(environment.physics)
    reach = np.abs(label[2, :3]) @ environment.task.object.asset.label.extents / 2
    joints = tcp_at((*label[:2, 3], label[2, 3] + reach - 0.01))  # around its top
    strict = CollisionQuery(TRANSIT, opening=0.08)
    blocked = scene.first_collision(joints, strict)
    assert blocked is not None and any(n.startswith("object_0/") for n in blocked[:2])
    lenient = Clearance(arm=0.001, target=-np.inf, attached=0.0)
    hit = scene.first_collision(joints, replace(strict, clearance=lenient, target=geoms))
    assert hit is None or not any(n.startswith("object_0/") for n in hit[:2])


def test_loose_objects_may_be_pushed_as_far_as_the_contact_allowance(environment, scene, tcp_at):
    geoms = _attached(environment, scene).geoms
    label = environment.task.object.label_pose(environment.physics)
    reach = np.abs(label[2, :3]) @ environment.task.object.asset.label.extents / 2
    joints = tcp_at((*label[:2, 3], label[2, 3] + reach + 0.004))
    query = CollisionQuery(CONTACT, opening=0.0)
    _, _, distance = scene.first_collision(joints, query)
    assert geoms.any() and -0.02 < distance < CONTACT.arm
    assert not scene.in_collision(joints, replace(query, contact_allowance=0.001 - distance))
    assert scene.in_collision(joints, query.keeping(TRANSIT))


def test_questions_leave_no_trace(environment, scene, tcp_at):
    """Whatever was asked before, of whatever scene, the answers are the same."""
    low, held = tcp_at((0.45, 0.1, -0.01)), _attached(environment, scene)
    before = environment.physics.data.qpos.copy()
    elsewhere = scene.with_body_at(held.body, compose(np.eye(3), np.array([0.3, 0.9, 1.2])))

    def answers():
        return [
            scene.first_collision(low),
            scene.first_collision(HOME),
            scene.tcp_pose(HOME).tolist(),
            scene.touching(held.geoms, 0.002),
            elsewhere.touching(held.geoms, 0.002),
        ]

    first = answers()
    elsewhere.first_collision(low, held.query(CONTACT))
    scene.first_collision(low, CollisionQuery(opening=0.0, target=held.geoms))
    assert answers() == first
    assert first[3] and not first[4]  # it lies on the table, and hangs in the air
    with pytest.raises(ValueError, match="read-only"):
        scene.positions.qpos[:] = 0.0
    np.testing.assert_array_equal(environment.physics.data.qpos, before)
