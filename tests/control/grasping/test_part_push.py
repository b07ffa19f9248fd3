"""The hand tells how far a push has led a part, and whether something stopped it."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.control.grasping.handle_grasps import Push
from manipose_mj.control.grasping.part_motion import PartWay
from manipose_mj.control.grasping.part_push import reached_by
from manipose_mj.mjcf.panda.kinematics import HOME

X, _, Z = np.eye(3)
TURN = np.array([0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # of the arm about its base, along the way


@pytest.mark.parametrize(("share", "blocked"), [(0.0, True), (0.5, True), (1.0, False)])
def test_how_far_a_push_came_is_where_the_hand_is_on_its_way(share, blocked):
    shares = np.linspace(0.0, 1.0, 41)
    push = Push(np.zeros(3), X, Z, flat=True, sign=1)
    way = PartWay(push, HOME + shares[:, None] * TURN, 0.4 + shares, np.zeros(41))
    reached, stopped = reached_by(way, HOME + share * TURN)
    assert reached == pytest.approx(0.4 + share, abs=0.03)
    assert stopped is blocked
