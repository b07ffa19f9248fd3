"""Room for the hand in a cavity."""

from __future__ import annotations

import numpy as np

from manipose_mj.assets.asset import Cavity, GraspSet
from manipose_mj.poses import compose
from manipose_mj.tasks.articulated.hand_room import (
    Placement,
    count_clear,
    free_grasps,
    hands_around,
)

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


def test_over_a_drawer_the_hand_stays_between_its_front_and_what_it_is_pulled_out_of():
    hands = _hands()
    # Shallow: the hand is above it, and only the fingers are inside.
    cavity = Cavity(np.zeros(3), np.array([0.3, 0.4, 0.02]), True)
    drawn = np.array([0.0, 0.35])
    for place, room in ((0.0, 1), (0.12, 0), (-0.06, 0)):
        origin = np.array([0.0, place, -0.005])
        assert count_clear(hands, origin, cavity, UP)
        assert count_clear(hands, origin, cavity, UP, drawn=drawn) == room
        # Pulled out the other way, front and body are on the other sides.
        mirrored = origin * [1, -1, 1]
        assert count_clear(hands, mirrored, cavity, UP, drawn=-drawn) == room


def test_grasps_count_where_the_arm_reaches_them():
    pose = np.eye(4)
    pose[:3, :3] = DOWN
    grasps = GraspSet(pose[None], np.array([WIDTH]), np.ones((1, 1), bool), held=1)
    cavity = Cavity(np.zeros(3), np.array([0.4, 0.4, 0.1]), True)
    for x, reached in ((0.5, 1), (1.2, 0)):
        world = compose(np.eye(3), np.array([x, 0.0, 0.2]))
        assert free_grasps(grasps, 0, np.eye(4), cavity, UP) == 1
        assert free_grasps(grasps, 0, np.eye(4), cavity, UP, cavity_world=world) == reached
