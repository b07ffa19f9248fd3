"""Which grasps of what lies in a pile can be had, and once what has been set aside."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.poses import compose
from manipose_mj.tasks.clutter.lying_pile import LyingPile
from manipose_mj.tasks.clutter.pile import Pile

LEAST = 6
REST = 0  # the can upright


@pytest.fixture(scope="module")
def can():
    return catalogue.load("can", 0)


def _lying(can, obstacles, supports=(), at=(0.5, 0.0)):
    """Three cans in a row, far apart, of which hands are said to meet these."""
    count, grasps = 3, len(can.grasps)
    met = np.zeros((count, grasps, count + 1), bool)
    for i, j in obstacles:
        met[i, :, j] = True
    met[:, :, -1] = ~can.grasps.clear[:, REST].astype(bool)
    supported = np.zeros((count, count), bool)
    for i, j in supports:
        supported[i, j] = True
    poses = np.stack([can.stable_poses[REST].pose] * count)
    poses[:, 1, 3] += [-0.15, 0.0, 0.15]
    pile = Pile(np.arange(count), poses, supported, met)
    return LyingPile(pile, (can,) * count, compose(np.eye(3), np.array([*at, 0.0])), 1.0)


def _count(lying, index, moved):
    return int(lying.usable(index, LEAST, moved).any(axis=1).sum())


def test_what_nothing_blocks_can_be_had_at_once(can):
    assert _count(_lying(can, []), 0, 0) >= LEAST


def test_a_blocker_that_can_go_counts_as_one_move(can):
    lying = _lying(can, [(0, 1)])
    assert _count(lying, 0, 0) == 0
    assert _count(lying, 0, 1) >= LEAST


def test_what_lies_on_an_object_has_to_go_with_all_that_lies_on_that(can):
    lying = _lying(can, [], supports=[(1, 0), (2, 1)])
    assert _count(lying, 0, 1) == 0
    assert _count(lying, 0, 2) >= LEAST


def test_objects_that_block_each_other_never_come_free(can):
    lying = _lying(can, [(0, 1), (1, 2), (2, 1)])
    assert _count(lying, 0, 3) == 0


def test_a_pile_out_of_the_arms_reach_offers_nothing(can):
    assert _count(_lying(can, [], at=(1.6, 0.0)), 0, 0) == 0


def test_grasps_have_to_reach_the_goal_too_and_be_clear_of_the_table_there(can):
    lying = _lying(can, [])
    usable = lying.usable(0, LEAST, 0)

    def count(x):
        pose = can.stable_poses[REST].pose @ can.label.pose
        pose[:2, 3] = x, 0.2
        return int(lying.usable_to(0, usable, pose, REST).sum())

    assert LEAST <= count(0.5) <= usable.any(axis=1).sum()
    assert count(1.6) == 0
