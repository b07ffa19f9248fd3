"""Where an object of a guessed frame is set down: at rest, next to what was asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.assets.asset import StablePose
from manipose_mj.control.planning.table_places import DROP_HEIGHT, settled
from manipose_mj.control.planning.transport import destinations
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.goals import PoseGoal
from tests.control.language.scenes import rigid

X, Y, Z = np.eye(3)


def a_bar(tilt: float):
    """A bar that lies on the table, whose label is tilted in it by so much [rad] and 1.5 cm above the table."""
    flat = rotation_about(Y, tilt)
    rests = (
        StablePose(flat, 0.015, 0.6),
        StablePose(rotation_about(X, np.pi / 2) @ flat, 0.03, 0.4),
    )
    bar = rigid("bar", "bar", (0.2, 0.03, 0.03), (0.0, 0.0, 0.0))
    return replace(bar, rests=rests, pose=compose(flat, np.array([0.5, 0.1, 0.015])))


def test_a_tilted_frame_is_set_down_flat_and_turned_as_it_was_asked():
    bar = a_bar(np.deg2rad(7))
    asked = compose(rotation_about(Z, 0.8), np.array([0.4, -0.2, 0.02]))
    found = settled(bar, asked)
    np.testing.assert_allclose(found[2, :3], bar.rests[0].rotation[2], atol=1e-9)
    np.testing.assert_allclose(found[:3, 3], [0.4, -0.2, 0.015 + DROP_HEIGHT])
    turned = asked[:3, :3].T @ found[:3, :3]
    assert np.arccos((np.trace(turned) - 1) / 2) == pytest.approx(np.deg2rad(7), abs=1e-6)


def test_what_is_asked_for_stays_where_no_rest_is_near():
    bar = a_bar(0.0)
    asked = compose(rotation_about(Y, 0.7), np.array([0.4, -0.2, 0.1]))
    np.testing.assert_array_equal(settled(bar, asked), asked)
    np.testing.assert_array_equal(settled(replace(bar, rests=()), asked), asked)


def test_only_guessed_frames_settle():
    bar = a_bar(np.deg2rad(7))
    goal = PoseGoal("bar", compose(np.eye(3), np.array([0.4, -0.2, 0.02])))
    assert len(destinations(goal, bar)) == 1
    poses = destinations(goal, replace(bar, guessed_frame=True))
    assert len(poses) == 2
    np.testing.assert_array_equal(poses[1], goal.pose)
