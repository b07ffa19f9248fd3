"""What is carried keeps far from all else; only where no path is found, and one is needed, it passes nearer."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from manipose_mj.control.grasping.retraction import transport_path
from manipose_mj.control.motion import motion_planner
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.collision_query import ROUNDED, TRANSIT, AttachedObject
from manipose_mj.mjcf.panda.robot import HOME

TIMESTEP = 0.02


def test_only_a_path_that_is_needed_may_pass_near():
    asked = []

    def free_path(start, goal, query, *, near=False):
        asked.append(near)
        return np.stack([start, goal]) if near else None

    planner = SimpleNamespace(
        free_path=free_path, backed_off=lambda q, distance: None, line=lambda *a: None
    )
    held = AttachedObject(1, np.zeros(1, bool), np.eye(4))
    assert transport_path(planner, HOME, HOME, held) is None  # type: ignore[arg-type]
    assert not any(asked)
    assert transport_path(planner, HOME, HOME, held, pressed=True) is not None  # type: ignore[arg-type]
    assert asked[-1] and not any(asked[:-1])


@pytest.mark.parametrize(("near", "clearance"), [(False, TRANSIT), (True, ROUNDED)])
def test_near_is_as_near_as_at_rounded_corners(scene, arm, tcp_at, monkeypatch, near, clearance):
    seen = []

    def plan_path(start, goal, collides: partial, rng):
        seen.append(collides.keywords["query"].clearance)

    monkeypatch.setattr(motion_planner, "plan_path", plan_path)
    planner = MotionPlanner(scene, arm, TIMESTEP, np.random.default_rng(0))
    assert planner.free_path(HOME, tcp_at((0.35, -0.1, 0.25)), near=near) is None
    assert seen == [clearance]
