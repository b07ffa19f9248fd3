"""The space behind an opening goes on as far as a camera looks into it."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.control.furniture.seen_through import widened
from manipose_mj.control.furniture.sensing.scene_cloud import Sight, hidden_from, seen_past
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics

HOLE = np.array([[-0.1, -0.10, 0.02], [0.2, 0.12, 0.28]])
BODY = np.array([[-0.2, -0.30, 0.0], [0.22, 0.30, 0.30]])


@pytest.mark.parametrize("wall", [-0.13, -0.20, -0.25])
def test_a_side_that_is_looked_past_moves_to_the_wall_and_no_further(wall):
    found = widened(HOLE, BODY, lambda points: points[:, 1] > wall)
    assert wall <= found[0, 1] < wall + 0.011
    # Nothing stops the others but the body's own shell.
    np.testing.assert_allclose(found[0, 0], BODY[0, 0] + 0.02, atol=0.011)
    np.testing.assert_allclose(found[1, 1], BODY[1, 1] - 0.02, atol=0.011)
    # Objects stand on the floor, and the mouth is where the door was.
    assert (found[0, 2], found[1, 0]) == (HOLE[0, 2], HOLE[1, 0])
    assert found[1, 2] <= BODY[1, 2] - 0.02 + 1e-9


def test_where_nothing_is_looked_past_it_stays():
    found = widened(HOLE, BODY, lambda points: np.zeros(len(points), bool))
    np.testing.assert_array_equal(found, HOLE)


def test_a_gap_in_a_side_does_not_move_it():
    """Such as the slit between a shelf and a wall."""
    found = widened(HOLE, BODY, lambda points: points[:, 2] < 0.08)
    np.testing.assert_array_equal(found[:, 1], HOLE[:, 1])


def test_a_camera_looks_past_what_is_before_the_wall_that_it_measures():
    depth = np.full((48, 64), 1.0)
    depth[:, :8] = 0.0  # where nothing was measured
    pose = np.eye(4)
    pose[:3, 3] = [0.3, 0.2, 0.1]
    sights = [Sight(depth, Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5), pose)]
    # In the camera's frame, which is the object's: before the wall, at it, a little behind it, far behind it, beside what is seen.
    points = np.array(
        [[0, 0, 0.9], [0, 0, 0.998], [0, 0, 1.01], [0, 0, 1.2], [-0.45, 0, 0.9], [2, 0, 0.9]]
    )
    np.testing.assert_array_equal(
        seen_past(sights, pose)(points), [True, False, False, False, False, False]
    )
    np.testing.assert_array_equal(
        hidden_from(sights, pose)(points), [False, False, False, True, True, True]
    )
