"""Handles and hinges fitted to what a cloud shows of them: a door with a bar, drawn point by point."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.poses import SymmetryGroup, compose, pose_error, rotation_about
from manipose_mj.ppf_jax.articulated.handle_fit import HandleFitConfig, Joint, fitted

# T_camera_door: X up along the bar, Y out of the door, Z across; the handle's centre in the middle.
_POSE = compose(rotation_about(np.array([0.6, 0.0, 0.8]), 0.7), np.array([0.1, -0.2, 1.1]))
_HEIGHT = 0.035  # of the handle's centre above the door [m]
_HINGE = 0.38  # across from the handle [m]
_ROWS = 16_384
_UP = jnp.asarray(_POSE[:3, 0], jnp.float32)
_FIT = jax.jit(lambda points, mask, joint, up: fitted(points, mask, joint, up, HandleFitConfig()))


def _grid(x, y, z):
    return np.stack(np.meshgrid(x, y, z), axis=-1).reshape(-1, 3)


def _door(length, rng, gap=None):
    """A cloud of a door, and of a bar of this length on it; the camera's frame [m].

    With a gap somewhere across, what lies beyond is another door's.
    """
    panel = _grid(
        np.arange(-0.25, 0.25, 0.004), [-_HEIGHT], np.arange(-0.06, _HINGE + 0.005, 0.004)
    )
    bar = _grid(np.arange(-length / 2, length / 2, 0.003), [0.005], np.arange(-0.005, 0.006, 0.003))
    if gap is not None:
        panel = panel[np.abs(panel[:, 2] - gap) > 0.006]
    # The bar hides what is behind it from a camera straight before it.
    hidden = (np.abs(panel[:, 0]) < length / 2) & (np.abs(panel[:, 2]) < 0.006)
    points = np.concatenate([panel[~hidden], bar])
    points = points + rng.normal(0, 0.0015, points.shape)
    return points @ _POSE[:3, :3].T + _POSE[:3, 3]


def _voted(offset, turn, hinge_at, hinge=0.97, depth=0.0):
    """A joint as votes might have it: moved in the door's frame, and turned about its normal; hinged behind it."""
    local = compose(rotation_about(np.array([0.0, 1.0, 0.0]), turn), np.asarray(offset, float))
    handle = _POSE @ local
    origin = handle @ [0.0, -_HEIGHT - depth, hinge_at, 1.0]
    values = handle, hinge, origin[:3], handle[:3, 0]
    return Joint(*(jnp.asarray(value, jnp.float32) for value in values))


def _padded(points):
    """Of one size, which compiles once; and what is a point."""
    rows = np.zeros((_ROWS, 3), np.float32)
    rows[: len(points)] = points
    return rows, np.arange(_ROWS) < len(points)


def _fit(points, joint, up=_UP):
    found = _FIT(*_padded(points), joint, up)
    return jax.tree.map(lambda leaf: np.asarray(leaf, float), found)


def _across(found):
    """Where the hinge is in the door's frame, across from the true handle [m]."""
    return ((found.origin - _POSE[:3, 3]) @ _POSE[:3, :3])[2]


@pytest.mark.parametrize("length", [0.12, 0.25, 0.44])
def test_a_bar_s_middle_direction_and_its_door_s_hinge_are_found(length):
    points = _door(length, np.random.default_rng(0))
    # Well within the bar, as votes are.
    found = _fit(points, _voted([0.3 * length, 0.003, -0.004], np.radians(9), 0.365))
    away, turned = pose_error(found.handle, _POSE, SymmetryGroup.identity())
    assert away < 0.008
    assert turned < np.radians(1.5)
    np.testing.assert_allclose(found.axis, _POSE[:3, 0], atol=0.03)
    assert _across(found) == pytest.approx(_HINGE, abs=0.008)


def test_a_knob_says_nothing_of_directions():
    points = _door(0.03, np.random.default_rng(1))
    found = _fit(points, _voted([0.008, 0.0, 0.0], np.radians(9), 0.36))
    assert np.linalg.norm(found.handle[:3, 3] - _POSE[:3, 3]) < 0.004
    assert pose_error(found.handle, _POSE, SymmetryGroup.identity())[1] == pytest.approx(
        np.radians(9), abs=1e-3
    )


def test_a_plain_door_ends_where_its_plane_does_and_not_before():
    points = _door(0.2, np.random.default_rng(2))
    sideways = jnp.asarray(_POSE[:3, 2], jnp.float32)
    for up in (_UP, sideways):
        found = _fit(points, _voted([0.0, 0.0, 0.0], 0.0, 0.15), up)
        assert _across(found) == pytest.approx(_HINGE, abs=0.008)
        # It may go on where nothing shows it.
        found = _fit(points, _voted([0.0, 0.0, 0.0], 0.0, 0.55), up)
        assert _across(found) == pytest.approx(0.55, abs=0.005)


def test_a_hinge_that_was_voted_far_from_any_edge_stays_where_there_is_a_gap():
    points = _door(0.2, np.random.default_rng(2), gap=0.2)
    found = _fit(points, _voted([0.0, 0.0, 0.0], 0.0, 0.15))
    assert _across(found) == pytest.approx(0.15, abs=0.005)


def test_a_level_hinge_moves_less_for_what_goes_on_may_be_a_plinth():
    points = _door(0.2, np.random.default_rng(2), gap=0.32)
    sideways = jnp.asarray(_POSE[:3, 2], jnp.float32)
    for voted, upright, level in ((0.33, _HINGE, 0.33), (0.368, _HINGE, _HINGE)):
        joint = _voted([0.0, 0.0, 0.0], 0.0, voted)
        assert _across(_fit(points, joint)) == pytest.approx(upright, abs=0.008)
        assert _across(_fit(points, joint, sideways)) == pytest.approx(level, abs=0.008)


def test_a_hinge_is_not_deeper_than_a_door_may_be_thick():
    points = _door(0.2, np.random.default_rng(6))
    for voted, kept in ((0.06, 0.018), (0.03, 0.018), (0.012, 0.012), (-0.01, -0.01)):
        found = _fit(points, _voted([0.0, 0.0, 0.0], 0.0, 0.375, depth=voted))
        depth = -((found.origin - found.handle[:3, 3]) @ found.handle[:3, 1]) - _HEIGHT
        assert depth == pytest.approx(kept, abs=0.004)
        assert _across(found) == pytest.approx(_HINGE, abs=0.008)


@pytest.mark.parametrize("share", [0.3, 0.1, 0.03])
def test_a_thin_cloud_takes_no_handle_away_from_where_it_was_voted(share):
    rng = np.random.default_rng(5)
    points = _door(0.25, rng)
    points = points[rng.random(len(points)) < share]
    away = [
        np.linalg.norm(
            _fit(points, _voted([along, 0.0, 0.0], 0.0, 0.365)).handle[:3, 3] - _POSE[:3, 3]
        )
        for along in (-0.05, 0.0, 0.05)
    ]
    assert max(away) < 0.055
    assert away[1] < 0.02


def test_what_no_point_shows_stays():
    joint = _voted([0.02, 0.0, 0.0], 0.1, 0.36)
    found = _fit(np.full((600, 3), 5.0), joint)
    for was, now in zip(jax.tree.leaves(joint), jax.tree.leaves(found), strict=True):
        np.testing.assert_allclose(now, was, atol=1e-5)


def test_a_slide_s_axis_goes_through_the_handle():
    points = _door(0.2, np.random.default_rng(3))
    found = _fit(points, _voted([0.05, 0.0, 0.0], 0.0, 0.36, hinge=0.02))
    np.testing.assert_allclose(found.origin, found.handle[:3, 3])
    assert np.linalg.norm(found.handle[:3, 3] - _POSE[:3, 3]) < 0.006


def test_many_parts_at_once_are_as_one_by_one():
    points, mask = _padded(_door(0.25, np.random.default_rng(4)))
    joints = [_voted([along, 0.0, 0.0], 0.05, 0.36) for along in (-0.06, 0.0, 0.06)]
    together = jax.vmap(lambda joint: _FIT(points, mask, joint, _UP))(
        jax.tree.map(lambda *rows: jnp.stack(rows), *joints)
    )
    for i, joint in enumerate(joints):
        np.testing.assert_allclose(
            together.handle[i], _FIT(points, mask, joint, _UP).handle, atol=1e-5
        )
