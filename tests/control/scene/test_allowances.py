"""What an uncertain estimate allows: fingers that touch the table, objects that seem to be in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from manipose_mj.assets.franka_hand import PAD_HALF_HEIGHT
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.collision_query import (
    CONTACT,
    TRANSIT,
    AttachedObject,
    CollisionQuery,
)


def test_fingers_may_touch_the_table_where_a_motion_ends_in_contact(scene, tcp_at):
    low = tcp_at((0.3, 0.4, PAD_HALF_HEIGHT + 0.0015))
    assert scene.in_collision(low, CollisionQuery(CONTACT))
    assert not scene.in_collision(low, CollisionQuery(CONTACT, support_allowance=0.004))
    assert scene.in_collision(low, CollisionQuery(TRANSIT, support_allowance=0.004))
    deep = tcp_at((0.3, 0.4, PAD_HALF_HEIGHT - 0.004))
    assert scene.in_collision(deep, CollisionQuery(CONTACT, support_allowance=0.004))


def test_a_planner_hands_its_allowance_on(scene, arm, tcp_at):
    planner = MotionPlanner(scene, arm, 0.02, np.random.default_rng(0))
    low = tcp_at((0.3, 0.4, PAD_HALF_HEIGHT + 0.0015))
    assert planner.collides(low, CollisionQuery(CONTACT))
    assert not planner.touching_support(0.004).collides(low, CollisionQuery(CONTACT))


def test_an_uncertain_object_may_seem_to_be_in_what_it_touches():
    held = AttachedObject(1, np.zeros(3, bool), np.eye(4), uncertainty=0.002)
    assert held.query(CONTACT).clearance.attached == CONTACT.attached - 0.002
    assert held.query(TRANSIT).clearance == TRANSIT, "in free space it keeps away as ever"
    assert replace(held, uncertainty=0.0).query(CONTACT).clearance == CONTACT
