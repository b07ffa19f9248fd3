"""The links behind the hand, from the pose of the TCP alone."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.mjcf.panda.forearm import LINK_RADII, links_behind
from manipose_mj.mjcf.panda.geometry import CAPSULES
from manipose_mj.mjcf.panda.kinematics import HOME, POSITION_LIMITS, link_poses, tcp_pose
from manipose_mj.poses import transform


def _balls(joints: np.ndarray) -> np.ndarray:
    """Along the capsules of links 5 and 6, `(p, 3)` [m]."""
    poses, found = link_poses(joints), []
    for number in (5, 6):
        for axis, _ in CAPSULES[f"link{number}"]:
            first, last = transform(poses[number - 1], np.reshape(axis, (2, 3)))
            found += [first, (first + last) / 2, last]
    return np.array(found)


@pytest.mark.parametrize("seed", range(20))
def test_one_way_is_that_of_the_arm(seed):
    rng, (low, high) = np.random.default_rng(seed), POSITION_LIMITS.T
    joints = rng.uniform(low + 0.3, high - 0.3)
    joints[6] = rng.choice(np.linspace(low[6], high[6], 12))  # turns that are looked at
    owner, balls = links_behind(tcp_pose(joints)[None])
    off = np.linalg.norm(balls - _balls(joints), axis=2).max(axis=1)
    assert (owner == 0).all()
    # The bend is looked at in steps of 9 deg; the forearm's other end is 0.23 m from its axis.
    assert off.min() < 0.03


def test_poses_out_of_reach_have_none():
    far = tcp_pose(HOME)
    far[0, 3] += 1.0
    owner, balls = links_behind(np.stack([tcp_pose(HOME), far]))
    assert set(owner.tolist()) == {0}
    assert balls.shape == (len(owner), len(LINK_RADII), 3)
