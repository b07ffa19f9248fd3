"""Ways to bend the arm for one pose of the hand."""

from __future__ import annotations

import numpy as np

from manipose_mj.control.grasping.candidates import postures, reachable
from manipose_mj.control.motion.batch_ik import forward
from manipose_mj.mjcf.panda.robot import HOME
from manipose_mj.poses import compose

DOWN = np.diag([1.0, -1.0, -1.0])


def test_an_arm_reaches_one_pose_in_several_ways_the_nearest_first():
    places = np.array([[0.5, 0.1, 0.2], [0.4, -0.3, 0.3], [2.0, 0.0, 0.2]])
    poses = np.stack([compose(DOWN, place) for place in places])
    ways = postures(poses, HOME)
    nearest = reachable(poses, HOME)
    np.testing.assert_array_equal(ways[0].index, nearest.index)
    np.testing.assert_array_equal(ways[0].joints, nearest.joints)
    assert 2 not in ways[0].index
    assert len(ways[1].index)
    before = dict(zip(ways[0].index.tolist(), ways[0].joints, strict=True))
    for way in ways[1:]:
        reached, _ = forward(way.joints)
        np.testing.assert_allclose(reached, poses[way.index], atol=3e-3)
        for index, joints in zip(way.index.tolist(), way.joints, strict=True):
            assert np.abs(joints - HOME).sum() >= np.abs(before[index] - HOME).sum()
            before[index] = joints


def test_the_elbow_really_goes_elsewhere():
    ways = postures(compose(DOWN, np.array([0.5, 0.1, 0.2]))[None], HOME)
    joints = np.stack([way.joints[0] for way in ways if len(way.index)])
    assert np.ptp(joints[:, 2]) > 0.3


def test_of_no_pose_there_is_none():
    (none,) = postures(np.zeros((0, 4, 4)), HOME)
    assert len(none.index) == 0
