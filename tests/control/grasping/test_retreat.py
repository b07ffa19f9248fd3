"""A hand that estimates have inside of what it has let go gets out of it, but no deeper in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.execution import letting_go
from manipose_mj.control.execution.letting_go import retreat_from
from manipose_mj.control.grasping.retreat import RETREATS, retreat
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.control.scene.collision_query import CONTACT, GRAZING, TRANSIT, CollisionQuery
from manipose_mj.failures import StageFailure

_AT = np.array([0.3, 0.4, 0.30])  # of the TCP; the can stands below
_BESIDE = np.array([0.02, 0.02, 0.0])  # the can is beneath a finger [m]


@pytest.fixture
def let_go(environment, scene, arm, tcp_at):
    """The hand over a can that has its top as deep in the fingers as is asked for [m]."""
    seen = OraclePerception(environment.task, environment.physics).observe()
    can = seen.objects["object"]
    joints = tcp_at(_AT)

    def at(depth: float):
        pose = np.eye(4)
        pose[:3, 3] = _AT + _BESIDE
        low = scene.with_body_at(can.body, pose)
        lowest = _lowest_free(low, can, joints, pose)
        pose[2, 3] = lowest + depth
        placed = scene.with_body_at(can.body, pose)
        estimate = replace(seen, joints=joints, scene=placed)
        return MotionPlanner(placed, arm, 0.02, np.random.default_rng(0)), estimate, can

    return at


def _lowest_free(scene, can, joints, pose) -> float:
    """The height of the can from which on it touches the hand, which may not [m]."""
    touching = CollisionQuery(replace(CONTACT, arm=0.0))
    low, high = _AT[2] - 0.6, _AT[2]
    for _ in range(20):
        middle = (low + high) / 2
        pose[2, 3] = middle
        collides = scene.with_body_at(can.body, pose).in_collision(joints, touching)
        low, high = (low, middle) if collides else (middle, high)
    return low


def test_the_hand_backs_out_of_what_estimates_have_it_in(let_go):
    planner, estimate, can = let_go(0.010)
    touched = frozenset({planner.body_name(can.body)})
    usual = CollisionQuery(CONTACT, target=can.geoms)
    assert planner.collides(estimate.joints, usual)
    assert retreat(planner, estimate, can.geoms, touched) is None
    line = retreat(planner, estimate, can.geoms, touched, excused=True)
    assert line is not None
    risen = planner.tcp_pose(line[-1])[2, 3] - _AT[2]
    assert risen == pytest.approx(RETREATS[0], abs=2e-3)
    assert not planner.collides(line[-1], CollisionQuery(TRANSIT))


def test_it_goes_no_deeper_into_anything(let_go, tcp_at):
    planner, estimate, can = let_go(0.010)
    usual = CollisionQuery(CONTACT, target=can.geoms)
    excused = planner.excusing(estimate.joints, usual)
    assert not planner.collides(estimate.joints, excused)
    deeper = tcp_at(_AT - [0.0, 0.0, 0.004])
    assert planner.collides(deeper, excused)
    assert planner.ignored(usual) == frozenset()
    assert planner.ignored(excused) >= {"world"}


def test_a_hand_closer_than_allowed_that_touches_nothing_may_stay_so(let_go, tcp_at):
    planner, estimate, _ = let_go(-0.0005)
    grazing = CollisionQuery(GRAZING)
    assert planner.collides(estimate.joints, grazing)
    excused = planner.excusing(estimate.joints, grazing)
    assert not planner.collides(estimate.joints, excused)
    assert planner.collides(tcp_at(_AT - [0.0, 0.0, 0.004]), excused)


def test_a_hand_that_touches_nothing_is_excused_for_nothing(let_go):
    planner, estimate, can = let_go(-0.050)
    query = CollisionQuery(CONTACT, target=can.geoms)
    excused = planner.excusing(estimate.joints, query)
    assert excused.depths is not None and not excused.depths.any()
    closer = let_go(0.010)[0]
    assert closer.collides(estimate.joints, excused)


def test_what_has_fallen_from_the_hand_needs_no_way_back(let_go, monkeypatch):
    monkeypatch.setattr(letting_go, "retreat", lambda *args: None)
    planner, estimate, can = let_go(0.0)
    with pytest.raises(StageFailure, match="no way to back off"):
        retreat_from(planner, estimate, can.name)
    planner, estimate, can = let_go(-0.2)
    np.testing.assert_array_equal(retreat_from(planner, estimate, can.name), estimate.joints[None])
