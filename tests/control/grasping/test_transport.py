"""What is carried keeps far from all else; where a path is needed and not found, it passes nearer, or is sought for longer."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from manipose_mj.control.grasping.retraction import transport_path
from manipose_mj.control.motion import motion_planner
from manipose_mj.control.motion.free_motion import FreeMotionConfig
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.collision_query import ROUNDED, TRANSIT, AttachedObject
from manipose_mj.mjcf.panda.robot import HOME

TIMESTEP = 0.02


def test_only_a_path_that_is_needed_may_pass_near_or_take_long():
    asked = []

    def free_path(start, goal, query, *, near=False, patient=False):
        asked.append("patient" if patient else "near" if near else "usual")
        return np.stack([start, goal]) if patient else None

    planner = SimpleNamespace(
        free_path=free_path, backed_off=lambda q, distance: None, line=lambda *a: None
    )
    held = AttachedObject(1, np.zeros(1, bool), np.eye(4))
    assert transport_path(planner, HOME, HOME, held) is None  # type: ignore[arg-type]
    assert set(asked) == {"usual"}
    asked.clear()
    assert transport_path(planner, HOME, HOME, held, pressed=True) is None  # type: ignore[arg-type]
    assert asked == ["usual", "near"]
    asked.clear()
    path = transport_path(planner, HOME, HOME, held, pressed=True, patient=True)  # type: ignore[arg-type]
    assert path is not None and asked == ["usual", "near", "patient"]


@pytest.mark.parametrize(("near", "clearance"), [(False, TRANSIT), (True, ROUNDED)])
def test_near_is_as_near_as_at_rounded_corners(scene, arm, tcp_at, monkeypatch, near, clearance):
    seen = []

    def plan_path(start, goal, collides: partial, rng, config):
        seen.append(collides.keywords["query"].clearance)

    monkeypatch.setattr(motion_planner, "plan_path", plan_path)
    planner = MotionPlanner(scene, arm, TIMESTEP, np.random.default_rng(0))
    assert planner.free_path(HOME, tcp_at((0.35, -0.1, 0.25)), near=near) is None
    assert seen == [clearance]


@pytest.mark.parametrize("patient", [False, True])
def test_a_patient_search_takes_more_nodes(scene, arm, tcp_at, monkeypatch, patient):
    nodes = []

    def plan_path(start, goal, collides, rng, config):
        nodes.append((config or FreeMotionConfig()).max_nodes)

    monkeypatch.setattr(motion_planner, "plan_path", plan_path)
    planner = MotionPlanner(scene, arm, TIMESTEP, np.random.default_rng(0))
    assert planner.free_path(HOME, tcp_at((0.35, -0.1, 0.25)), patient=patient) is None
    usual = FreeMotionConfig().max_nodes
    assert nodes[0] > 4 * usual if patient else nodes == [usual]
