"""Room for the hand in a cavity."""

from __future__ import annotations

import numpy as np

from manipose_mj.assets.asset import Cavity, GraspSet
from manipose_mj.tasks.articulated.hand_room import Placement, count_clear, hands_around

DOWN = np.diag([1.0, -1.0, -1.0])
UP = np.array([0.0, 0.0, 1.0])
WIDTH = 0.04


def _hands():
    """One grasp from above of something at the origin."""
    pose = np.eye(4)
    pose[:3, :3] = DOWN
    grasps = GraspSet(pose[None], np.array([WIDTH]), np.ones((1, 1), bool), held=1)
    return hands_around(grasps, 0, np.eye(3), UP)


def test_fingers_stand_alike_on_either_side():
    corners = _hands()[0]
    np.testing.assert_allclose(corners[1:, :, 1].min(), -corners[1:, :, 1].max())
    inner = np.abs(corners[1:, :, 1]).min()
    assert inner == WIDTH / 2


def test_a_cavity_as_wide_as_the_open_hand_has_room_and_a_narrower_one_has_not():
    hands, depth = _hands(), 0.1
    needed = 2 * np.abs(hands[0, 1:, :, 1]).max()
    for wider, room in ((0.01, 1), (0.0, 0)):
        cavity = Cavity(np.zeros(3), np.array([0.4, needed + wider, depth]), True)
        for side in (-1.0, 1.0):
            # Beside the middle the finger on that side meets the wall.
            assert count_clear(hands, np.array([0.0, 0.0, 0.02]), cavity, UP) == room
            assert not count_clear(hands, np.array([0.0, side * 0.02, 0.02]), cavity, UP)


def test_what_lies_beside_takes_the_room_of_a_finger_on_either_side():
    hands = _hands()
    cavity = Cavity(np.zeros(3), np.array([0.4, 0.4, 0.1]), True)
    origin = np.array([0.0, 0.0, -0.02])
    for side in (-1.0, 1.0):
        outside = side * (np.abs(hands[0, 1:, :, 1]).max() + 0.02)
        for place, room in ((outside + side * 0.005, 1), (outside - side * 0.005, 0)):
            other = Placement(np.array([0.0, place]), np.array([0.02, 0.02, 0.03]))
            assert count_clear(hands, origin, cavity, UP, (other,)) == room
