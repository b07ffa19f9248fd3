"""The axis of a surface of revolution is found from where its points are."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from manipose_mj.poses import rotation_angle
from manipose_mj.ppf_jax.rigid.revolution import RevolutionConfig, refined_axis

CONFIG = RevolutionConfig()
NOISE = 0.02  # of the points, in the cloud's units: about a millimetre of a cup


def _goblet(height):
    return 0.6 + 0.35 * np.sin(2.5 * height)


def _tube(height):
    return np.full_like(height, 0.7)


def _seen(profile, rng, *, wall=0.0, towards=(0.5, 0.8, 0.3), count=CONFIG.points):
    """Points of a surface about X with an open upper end, as seen from one side; and views."""
    towards = np.array(towards) / np.linalg.norm(towards)
    found = []
    while len(found) < count:
        height, turn = rng.uniform(-1, 1), rng.uniform(-np.pi, np.pi)
        radial = np.array([0.0, np.cos(turn), np.sin(turn)])
        slope = (profile(np.array([height + 1e-3])) - profile(np.array([height - 1e-3])))[0] / 2e-3
        outer = radial - slope * np.array([1.0, 0.0, 0.0])
        if outer @ towards > 0.1:
            found.append(profile(np.array([height]))[0] * radial + [height, 0, 0])
        elif wall and outer @ towards < -0.1:
            found.append((profile(np.array([height]))[0] - wall) * radial + [height, 0, 0])
    points = np.array(found) + NOISE * rng.standard_normal((count, 3))
    return points, np.broadcast_to(towards, points.shape)


def _off(points, views, rotation, origin, mask=None):
    """Angle [deg] and distance between the axes, after settling."""
    mask = np.ones(len(points), bool) if mask is None else mask
    arrays = (np.asarray(each, np.float32) for each in (points, views))
    turned, moved = refined_axis(
        *arrays,
        mask,
        np.asarray(rotation, np.float32),
        np.asarray(origin, np.float32),
        jnp.asarray(NOISE, jnp.float32),
        CONFIG,
    )
    tilt = np.degrees(np.arccos(np.clip(np.asarray(turned)[0, 0], -1, 1)))
    return tilt, float(np.linalg.norm(np.asarray(moved)[1:]))


@pytest.mark.sample(1)
@pytest.mark.parametrize("profile", [_goblet, _tube])
@pytest.mark.parametrize("wall", [0.0, 0.1])
def test_a_frame_that_is_off_is_put_right(profile, wall):
    tilts, shifts = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        points, views = _seen(profile, rng, wall=wall)
        turn = Rotation.from_rotvec(np.radians(2.0) * _across(rng)).as_matrix()
        tilt, shift = _off(points, views, turn, 0.08 * _across(rng))
        tilts.append(tilt)
        shifts.append(shift)
    # Of 2 deg and 0.08; what little a tube with a wall says of its direction is weighed against the start.
    assert np.median(tilts) < 1.1
    assert np.median(shifts) < 0.03


def test_a_thin_wall_s_two_sides_are_not_taken_for_one():
    # Seen from above its rim, a tube shows the near half from outside and the far half from inside.
    rng = np.random.default_rng(0)
    points, views = _seen(_tube, rng, wall=0.1)
    views_of_nobody = np.zeros_like(views)
    right = _off(points, views, np.eye(3), np.zeros(3))[1]
    confused = _off(points, views_of_nobody, np.eye(3), np.zeros(3))[1]
    assert right < 0.01
    assert confused > 2 * right


def test_padding_counts_for_nothing_and_strays_for_little():
    rng = np.random.default_rng(1)
    points, views = _seen(_goblet, rng)
    turn = Rotation.from_rotvec([0.0, 0.02, 0.01]).as_matrix()
    tilt, shift = _off(points, views, turn, np.zeros(3))
    padded = np.concatenate([points, np.zeros((64, 3))]), np.concatenate([views, np.zeros((64, 3))])
    mask = np.arange(len(points) + 64) < len(points)
    assert _off(*padded, turn, np.zeros(3), mask) == pytest.approx((tilt, shift), abs=2e-3)
    strayed = points.copy()
    strayed[::10] += rng.uniform(-0.5, 0.5, (len(strayed[::10]), 3))
    tilt, shift = _off(strayed, views, turn, np.zeros(3))
    assert tilt < 0.8 and shift < 0.03


def test_what_cannot_be_told_stays_as_it_was():
    """A ball has every axis, and points that are all the same have none."""
    turn = Rotation.from_rotvec([0.0, 0.3, -0.2]).as_matrix()
    rng = np.random.default_rng(2)
    directions = rng.standard_normal((CONFIG.points, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[:, 1] = np.abs(directions[:, 1])
    views = np.broadcast_to([0.0, 1.0, 0.0], directions.shape)
    arguments = [np.asarray(a, np.float32) for a in (directions, views)]
    mask, origin = np.ones(CONFIG.points, bool), np.zeros(3, np.float32)
    frame = np.asarray(turn, np.float32)
    found, moved = refined_axis(*arguments, mask, frame, origin, jnp.float32(NOISE), CONFIG)
    assert rotation_angle(np.asarray(found), turn) < np.radians(0.5)
    assert np.linalg.norm(moved) < 0.01
    same = np.full((CONFIG.points, 3), 0.3, np.float32)
    found, moved = refined_axis(same, arguments[1], mask, frame, origin, jnp.float32(NOISE), CONFIG)
    assert np.isfinite(found).all() and np.isfinite(moved).all()
    assert rotation_angle(np.asarray(found), turn) < np.radians(0.5)


@pytest.mark.full
def test_it_maps_over_a_batch():
    rng = np.random.default_rng(3)
    clouds = [_seen(_goblet, rng) for _ in range(2)]
    points, views = (np.stack(column).astype(np.float32) for column in zip(*clouds, strict=True))
    mask = np.ones(points.shape[:2], bool)
    frames = np.stack([np.eye(3, dtype=np.float32)] * 2)
    origins, noise = np.full((2, 3), 0.02, np.float32), np.full(2, NOISE, np.float32)
    both = jax.vmap(lambda *row: refined_axis(*row, CONFIG))(
        points, views, mask, frames, origins, noise
    )
    for i in range(2):
        row = (points[i], views[i], mask[i], frames[i], origins[i], jnp.float32(NOISE))
        for found, alone in zip(both, refined_axis(*row, CONFIG), strict=True):
            np.testing.assert_allclose(found[i], alone, atol=1e-4)


def _across(rng):
    turn = rng.uniform(-np.pi, np.pi)
    return np.array([0.0, np.cos(turn), np.sin(turn)])
