"""Where a hinge is likely to be, and which estimated axes are no door's."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.control.furniture.door_hinge import can_be_a_door, likely_hinge
from manipose_mj.control.furniture.handle_shape import ACROSS_FRONT, UP_FRONT
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
        (Y, 0.0, (-0.1, 0.57), True),
        (Y, 0.0, (0.07, 0.57), False),  # no flap has its handle in a corner
        (np.array([0.5, 0.0, 0.85]), -0.29, (0.07, 0.4), False),
    ],
)
def test_hinges_of_doors_lie_in_the_front_at_an_edge(axis, across, place, can):
    origin, axis = np.array([0.2, across, 0.3]), axis / np.linalg.norm(axis)
    assert can_be_a_door(origin, axis, handle(*place), PANEL) is can
