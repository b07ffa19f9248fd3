"""Where a hinge is likely to be, and which estimated axes are no door's."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.control.furniture.fit.door_hinge import (
    can_be_a_door,
    hung,
    likely_hinge,
    whole_front,
)
from manipose_mj.control.furniture.shapes.handle_shape import ACROSS_FRONT, UP_FRONT
from manipose_mj.poses import compose

PANEL = np.array([[0.18, -0.3, 0.1], [0.20, 0.1, 0.6]])
X, Y, Z = np.eye(3)


def handle(y: float, z: float, rotation: np.ndarray = UP_FRONT) -> np.ndarray:
    return compose(rotation, np.array([0.23, y, z]))


@pytest.mark.parametrize(
    ("place", "rotation", "origin", "axis"),
    [
        ((0.07, 0.4), UP_FRONT, (-0.3, 1), -Z),
        ((-0.27, 0.2), UP_FRONT, (0.1, 1), Z),
        ((-0.1, 0.57), ACROSS_FRONT, (0.1, 2), Y),
        ((-0.1, 0.13), ACROSS_FRONT, (0.6, 2), -Y),
    ],
)
def test_a_door_turns_about_the_edge_that_is_farthest_from_its_handle(
    place, rotation, origin, axis
):
    pose = handle(*place, rotation)
    found, way = likely_hinge(pose, PANEL)
    np.testing.assert_allclose(way, axis)
    assert found[origin[1]] == pytest.approx(origin[0])
    # It opens outwards.
    assert np.cross(way, pose[:3, 3] - found)[0] > 0


@pytest.mark.parametrize(
    ("axis", "across", "place", "can"),
    [
        (X, 0.0, (0.07, 0.4), False),  # a knob's
        (-Z, -0.29, (0.07, 0.4), True),
        (-Z, -0.1, (0.07, 0.4), False),  # in the middle of its panel
        (Z, -0.29, (0.07, 0.4), False),  # it would open into the body
        (-Z, -0.29, (-0.15, 0.4), True),
        (-Z, -0.29, (-0.24, 0.4), False),  # its handle is beside the hinge
        (Z, 0.08, (0.03, 0.4), False),
        (-Y, 0.0, (-0.1, 0.57), False),
        (Y, 0.0, (-0.1, 0.57), True),
        (Y, 0.0, (0.07, 0.57), False),  # no flap has its handle in a corner
        (np.array([0.5, 0.0, 0.85]), -0.29, (0.07, 0.4), False),
    ],
)
def test_hinges_of_doors_lie_in_the_front_at_an_edge(axis, across, place, can):
    origin, axis = np.array([0.2, across, 0.3]), axis / np.linalg.norm(axis)
    assert can_be_a_door(origin, axis, handle(*place), PANEL) is can


def test_a_wide_level_bar_is_a_flaps_that_opens_downwards():
    pose = handle(-0.1, 0.4, ACROSS_FRONT)  # near no edge
    assert abs(likely_hinge(pose, PANEL, length=0.12)[1][2]) == 1.0
    origin, axis = likely_hinge(pose, PANEL, length=0.3)
    np.testing.assert_allclose(axis, Y)
    assert origin[2] == pytest.approx(PANEL[0, 2])
    upright = np.array([0.2, -0.29, 0.3]), -Z
    assert can_be_a_door(*upright, pose, PANEL, length=0.12)
    assert not can_be_a_door(*upright, pose, PANEL, length=0.3)


@pytest.mark.parametrize("curved", [0.0, 0.02])
def test_beyond_a_gap_there_is_another_front(curved):
    y, z = (grid.ravel() for grid in np.mgrid[-0.3:0.6:0.01, 0.1:0.6:0.01])
    x = 0.2 - curved * ((y + 0.1) / 0.2) ** 2
    seen = np.column_stack([x, y, z])[(y < 0.1) | (y > 0.4)]  # between them there is room for legs
    between = np.array([[0.0, -0.3, 0.1], [0.2, 0.6, 0.6]])
    found = whole_front(seen, 0.2, handle(0.05, 0.5), between)
    np.testing.assert_allclose(found, [[0.0, -0.3, 0.1], [0.2, 0.1, 0.6]], atol=0.011)
    np.testing.assert_allclose(whole_front(seen[:40], 0.2, handle(0.05, 0.5), between), between)


def test_a_front_ends_where_only_the_edge_of_a_table_top_goes_on():
    y, z = (grid.ravel() for grid in np.mgrid[-0.6:0.6:0.01, 0.0:0.7:0.01])
    door = (y > 0.0) & (y < 0.16)
    seen = np.column_stack([np.full_like(y, 0.2), y, z])[door | (z > 0.66)]
    between = np.array([[0.0, -0.6, 0.0], [0.2, 0.6, 0.7]])
    found = whole_front(seen, 0.2, handle(0.05, 0.6), between)
    np.testing.assert_allclose(found[:, 1], [0.0, 0.16], atol=0.021)
    np.testing.assert_allclose(found[:, 2], [0.0, 0.7], atol=0.021)


def test_a_flap_ends_above_a_plinth_that_a_curved_front_would_take_in():
    y, z = (grid.ravel() for grid in np.mgrid[-0.3:0.3:0.01, 0.0:0.6:0.01])
    seen = np.column_stack([np.where(z < 0.12, 0.18, 0.2), y, z])
    between = np.array([[0.0, -0.3, 0.0], [0.2, 0.3, 0.6]])
    at = handle(0.0, 0.5, ACROSS_FRONT)
    assert whole_front(seen, 0.2, at, between)[0, 2] == pytest.approx(0.0)
    assert whole_front(seen, 0.2, at, between, 0.012)[0, 2] == pytest.approx(0.12, abs=0.011)


def test_what_is_far_higher_than_wide_is_no_flap_but_for_a_wide_bar():
    tall = np.array([[0.18, -0.1, 0.0], [0.20, 0.1, 0.6]])
    knob = handle(-0.02, 0.55, ACROSS_FRONT)
    assert abs(likely_hinge(knob, tall)[1][2]) == 1.0
    assert not can_be_a_door(np.array([0.2, 0.0, 0.0]), Y, knob, tall)
    assert abs(likely_hinge(knob, tall, length=0.15)[1][1]) == 1.0


@pytest.mark.parametrize(("y", "hinge"), [(-0.45, 0.0), (-0.05, -0.5), (0.05, 0.5)])
def test_what_is_too_wide_for_one_door_is_two(y, hinge):
    wide = np.array([[0.18, -0.5, 0.1], [0.20, 0.5, 0.6]])
    origin, axis = likely_hinge(handle(y, 0.4), wide)
    assert abs(axis[2]) == 1.0
    assert origin[1] == pytest.approx(hinge)
    assert can_be_a_door(origin, axis, handle(y, 0.4), wide)
    far = np.array([0.2, -hinge or 0.5, 0.3])
    assert not can_be_a_door(far, axis, handle(-0.45, 0.4), wide)


@pytest.mark.parametrize(
    ("axis", "place", "behind"),
    [(Z, (0.15, 0.08, 0.4), 0.010), (-Y, (0.15, -0.1, 0.6), 0.022)],
)
def test_a_hinge_hangs_half_way_to_where_doors_have_theirs_behind_the_front(axis, place, behind):
    face = np.stack(np.meshgrid([0.2], np.arange(-0.3, 0.1, 0.01), np.arange(0.1, 0.6, 0.01)), -1)
    origin = hung(np.array(place), axis, handle(-0.1, 0.3), face.reshape(-1, 3), PANEL)
    assert origin[0] == pytest.approx((place[0] + 0.2 - behind) / 2)
    unseen = hung(np.array(place), axis, handle(-0.1, 0.3), np.zeros((0, 3)), PANEL)
    assert unseen[0] == place[0]


@pytest.mark.parametrize(("thought", "hangs"), [(0.08, 0.092), (0.13, 0.092), (0.02, 0.02)])
def test_an_upright_hinge_near_the_side_of_the_body_is_just_within_it(thought, hangs):
    place = np.array([0.2, thought, 0.4])
    assert hung(place, Z, handle(-0.2, 0.4), np.zeros((0, 3)), PANEL)[1] == pytest.approx(hangs)
