"""What the hand is thought to hold is where the hand is, unless cameras see that it is not."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from manipose_mj.control.furniture.sensing.scene_cloud import Sight
from manipose_mj.control.perception.in_hand import InHand, is_gone
from manipose_mj.control.perception.pose_sensing import SensedPose
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import compose
from tests.control.perception.recalled import Recalled, perception_of

BOX = np.array(list(product((-0.03, 0.03), repeat=3)))


def sensed_at(z: float) -> SensedPose:
    pose = compose(np.eye(3), np.array([0.0, 0.0, z]))
    return SensedPose(pose, SimpleNamespace(hulls=(BOX,)), 0.001, 0.9, "front")


def sight(depth: float) -> Sight:
    """A camera at the origin that looks along z and measures the same depth everywhere [m]."""
    return Sight(np.full((60, 80), depth), Intrinsics(80, 60, 80.0, 80.0, 40.0, 30.0), np.eye(4))


@pytest.mark.parametrize(
    ("depths", "gone"),
    [
        ((2.0,), True),  # a wall behind it
        ((0.97,), False),  # its own surface
        ((0.5,), False),  # something before it
        ((0.5, 2.0), True),  # before one camera only
        ((0.0,), False),  # nothing was measured
    ],
)
def test_what_cameras_look_past_is_not_there(depths, gone):
    assert is_gone(sensed_at(1.0), sensed_at(3.0), lambda: [sight(d) for d in depths]) is gone


def test_what_has_not_moved_needs_no_look():
    def look():
        raise AssertionError("images take time")

    assert not is_gone(sensed_at(1.0), sensed_at(1.0), look)


@pytest.mark.parametrize(("width", "least"), [(0.05, 0.046), (0.004, 0.002)])
def test_fingers_that_have_closed_may_have_lost_it(width, least):
    held = InHand("object", np.eye(4), width)
    assert held.may_be_lost(least - 1e-4)
    assert not held.may_be_lost(least + 1e-4)


def test_an_object_that_the_hand_has_left_behind_out_of_sight_is_not_in_the_hand(cup, truth):
    perception = perception_of(cup, Recalled(*truth))
    perception.reset(0)
    joints, opening = cup.task.robot.configuration(cup.physics)
    before = perception.observe().objects["object"].label_pose
    perception.hold("object")
    hidden = compose(np.eye(3), np.array([0.5, 0.0, -1.0]))
    cup.task.object.place(cup.physics, hidden)
    for _ in range(25):
        cup.step(np.append(joints + [0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], opening))
        cup.task.object.place(cup.physics, hidden)
    np.testing.assert_allclose(perception.observe().objects["object"].label_pose, before)
