"""The arc of the gripper corrects a joint that clouds have wrong."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.joint_fit import (
    fitted_joint,
    gone_along,
    opening_of,
    points_of,
)
from manipose_mj.poses import compose, rotation_about

UP = np.array([0.0, 0.0, 1.0])
AHEAD = np.array([1.0, 0.0, 0.0])
HANDLE = np.array([0.05, 0.35, 0.1])
HINGE = Joint("hinge", np.array([0.0, 0.0, 0.1]), -UP, (0.0, 1.7))
NOISE = 0.0008  # of a hand on a bar [m]


def arc(swing: float, count: int = 40) -> np.ndarray:
    """Places of the handle as the door opens by `swing` [rad]."""
    rng = np.random.default_rng(0)
    turns = [rotation_about(HINGE.axis, angle) for angle in np.linspace(0, swing, count)]
    path = np.array([HINGE.origin + turn @ (HANDLE - HINGE.origin) for turn in turns])
    return path + rng.normal(0, NOISE, path.shape)


def poses(path: np.ndarray, turned: float = 0.0) -> np.ndarray:
    """A hand whose TCP goes along a path, and turns by so much about the vertical meanwhile [rad]."""
    turns = [rotation_about(UP, angle) for angle in np.linspace(0, turned, len(path))]
    return compose(np.array(turns), path)


def tilted(joint: Joint, degrees: float, about: np.ndarray = AHEAD) -> Joint:
    axis = rotation_about(about, np.radians(degrees)) @ joint.axis
    return Joint(joint.kind, joint.origin, axis, joint.range)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))


@pytest.mark.parametrize(("swing", "most"), [(0.2, 8.0), (0.6, 3.0), (1.2, 1.5)])
def test_the_longer_the_arc_the_better_a_tilted_hinge_is_corrected(swing, most):
    found = fitted_joint(tilted(HINGE, 20), poses(arc(swing))).joint
    assert angle(found.axis, HINGE.axis) < most


def test_a_hinge_whose_place_is_wrong_comes_to_be_where_it_is():
    wrong = Joint("hinge", HINGE.origin + [0.03, 0.10, 0.0], HINGE.axis, HINGE.range)
    found = fitted_joint(wrong, poses(arc(0.8), -0.8)).joint
    off = found.origin - HINGE.origin
    assert np.linalg.norm(off - (off @ UP) * UP) < 0.01


@pytest.mark.parametrize("turned", [0.0, -0.4])
def test_a_bar_off_the_middle_of_the_hand_misleads_nobody(turned):
    # The hand does not turn with the door: it pivots about the bar, which is not where the hand's middle is.
    offset = np.array([0.004, 0.009, 0.0])
    bars = arc(0.5)
    turns = poses(bars, turned)[:, :3, :3]
    hands = compose(turns, bars - turns @ offset)
    wrong = Joint("hinge", HINGE.origin + [0.03, 0.10, 0.0], HINGE.axis, HINGE.range)
    found = fitted_joint(wrong, hands)
    off = found.joint.origin - HINGE.origin
    assert np.linalg.norm(off - (off @ UP) * UP) < 0.02
    went = points_of(hands, found.offset)
    assert opening_of(found.joint, went[0], went[-1]) == pytest.approx(0.5, abs=0.03)


def test_a_short_way_changes_nothing():
    wrong = tilted(HINGE, 20)
    found = fitted_joint(wrong, poses(HANDLE + np.zeros((5, 3)))).joint
    np.testing.assert_array_equal(found.axis, wrong.axis)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_drawer_slides_where_it_went_pulled_or_pushed(sign):
    rng = np.random.default_rng(1)
    path = HANDLE + sign * np.linspace(0, 0.1, 30)[:, None] * AHEAD
    joint = tilted(Joint("slide", HANDLE, AHEAD, (0.0, 0.3)), 20, UP)
    found = fitted_joint(joint, poses(path + rng.normal(0, NOISE, path.shape))).joint
    assert angle(found.axis, AHEAD) < 1.0


def test_what_was_taken_for_a_drawer_is_a_door_where_it_goes_round():
    joint = Joint("slide", HANDLE, AHEAD, (0.0, 0.3))
    found = fitted_joint(joint, poses(arc(0.9))).joint
    assert found.kind == "hinge"
    assert angle(found.axis, HINGE.axis) < 3.0
    assert opening_of(found, HANDLE, arc(0.9)[-1]) == pytest.approx(0.9, abs=0.05)


def test_openings_are_what_brought_a_point_there():
    assert opening_of(HINGE, HANDLE, arc(0.7)[-1]) == pytest.approx(0.7, abs=0.01)
    slide = Joint("slide", HANDLE, AHEAD, (0.0, 0.3))
    assert opening_of(slide, HANDLE, HANDLE + [0.12, 0.03, 0.0]) == pytest.approx(0.12)


@pytest.mark.parametrize("swing", [-1.2, 0.02, 1.6, 3.1, 3.2, 4.5])
def test_doors_that_open_by_more_than_half_a_turn_are_not_shut(swing):
    assert opening_of(HINGE, HANDLE, arc(swing)[-1]) == pytest.approx(swing, abs=0.01)
    assert opening_of(HINGE, HANDLE, arc(swing)[-1], swing - 3.0) == pytest.approx(swing, abs=0.01)


@pytest.mark.parametrize("swing", [-3.2, -0.5, 3.2, 5.0])
def test_a_path_says_how_far_round_it_went(swing):
    assert gone_along(HINGE, arc(swing)) == pytest.approx(swing, abs=0.01)


@pytest.mark.parametrize("swing", [-0.1, 1.0, 3.1])
def test_below_half_a_turn_an_opening_is_the_angle_bit_for_bit(swing):
    path = arc(swing)
    first, last = (np.append((p - HINGE.origin)[:2], 0.0) for p in (path[0], path[-1]))
    angle = np.arctan2(np.cross(first, last) @ HINGE.axis, first @ last)
    assert opening_of(HINGE, path[0], path[-1], 0.4) == gone_along(HINGE, path) == angle


def test_a_drawer_slides_level_though_the_pull_lifts_the_hand():
    joint = Joint("slide", HANDLE, AHEAD, (0.0, 0.3))
    way = np.linspace(0, 0.1, 30)[:, None]
    lifted = HANDLE + way * AHEAD + 0.05 * way * UP
    found = fitted_joint(joint, poses(lifted)).joint
    assert found.kind == "slide"
    assert angle(found.axis, AHEAD) < 0.3
