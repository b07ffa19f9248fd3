"""The table of reachability: what it says the arm can take, inverse kinematics finds."""

from __future__ import annotations

import numpy as np

from manipose_mj.control.motion.batch_ik import forward, seeds_for, solve
from manipose_mj.mjcf.panda.kinematics import HOME, POSITION_LIMITS, tcp_pose
from manipose_mj.mjcf.panda.reachability import SHAPE, cells_of, is_reachable, with_margin
from manipose_mj.poses import compose, rotation_about

_UP = np.array([0.0, 0.0, 1.0])


def _poses(count: int) -> np.ndarray:
    """TCP poses of arms away from their limits, all around."""
    low, high = (POSITION_LIMITS + [0.3, -0.3]).T
    return forward(np.random.default_rng(0).uniform(low, high, (count, 7)))[0]


def test_what_is_said_to_be_reachable_is():
    rng = np.random.default_rng(1)
    turns = np.stack([rotation_about(_UP, a) for a in rng.uniform(-1, 1, 400)])
    places = rng.uniform([0.25, -0.5, -0.2], [0.8, 0.5, 0.8], (400, 3))
    poses = compose(turns @ _poses(400)[:, :3, :3], places)
    said = is_reachable(poses)
    assert 0.1 < said.mean() < 0.9
    more = rng.uniform(*POSITION_LIMITS.T, (15, said.sum(), 7))
    _, solved = solve(poses[said], np.concatenate([seeds_for(poses[said]), more]))
    assert solved.any(axis=0).mean() > 0.95


def test_most_of_what_the_arm_takes_is_said_to_be_reachable():
    found = is_reachable(_poses(2000))
    assert 0.45 < found.mean() < 1.0  # the margin costs the rest
    assert is_reachable(tcp_pose(HOME)[None])[0]


def test_half_a_turn_and_the_first_joint_change_nothing():
    poses = _poses(200)
    half = np.diag([-1.0, -1.0, 1.0, 1.0])
    about = compose(rotation_about(_UP, 0.7), np.zeros(3))
    for other in (poses @ half, about @ poses):
        cells, inside = cells_of(other)
        known, known_inside = cells_of(poses)
        assert (inside == known_inside).all()
        # Only poses on the border of two cells may change theirs.
        assert (cells == known).all(axis=1).mean() > 0.98


def test_far_and_odd_poses_are_not_reachable():
    pose = tcp_pose(HOME)
    far = pose.copy()
    far[0, 3] = 1.5
    assert not is_reachable(np.stack([far]))[0]


def test_a_cell_counts_only_with_its_neighbours():
    hit = np.zeros(SHAPE, bool)
    hit[4:7, 10, 3, 2] = hit[5, 9:12, 3, 2] = True
    kept = with_margin(hit)
    assert kept.sum() == 1 and kept[5, 10, 3, 2]
