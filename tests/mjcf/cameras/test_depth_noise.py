"""The sensor's noise has the deviations that its sources published."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.depth_noise import (
    KINECT,
    StructuredLight,
    axial_deviation,
    lateral_deviation,
    projector_shadow,
    quantised,
    structured_light,
)
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics

CAMERA = Intrinsics(320, 240, 585.0, 585.0, 159.5, 119.5)


def tilted_plane(distance: float, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Depth and cosine of incidence of a plane turned about the camera's y."""
    slopes = CAMERA.slopes()
    normal = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    rays = np.concatenate([slopes, np.ones((*slopes.shape[:2], 1))], axis=-1)
    depth = -distance * np.cos(angle) / (rays @ normal)
    cosine = -(rays @ normal) / np.linalg.norm(rays, axis=-1)
    return depth, cosine


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("degrees", [0, 30, 50])
def test_a_planes_depth_deviates_as_nguyen_measured(distance, degrees):
    depth, cosine = tilted_plane(distance, np.deg2rad(degrees))
    middle = np.abs(depth - distance) < 0.05 * distance
    noisy = structured_light(depth, cosine, CAMERA, np.random.default_rng(1))
    seen = middle & (noisy > 0)
    requested = 0.0012 + 0.0019 * (distance - 0.4) ** 2
    assert np.std((noisy - depth)[seen]) == pytest.approx(requested, rel=0.08)
    assert abs(np.mean((noisy - depth)[seen])) < 0.1 * requested


def test_an_edge_wavers_by_the_lateral_deviation():
    depth = np.full((4000, 80), 2.0)
    depth[:, 40:] = 0.8
    camera = Intrinsics(80, 4000, 585.0, 585.0, 39.5, 1999.5)
    sensor = type(KINECT)(baseline=0.0, speckle=0.0)
    noisy = structured_light(depth, np.ones_like(depth), camera, np.random.default_rng(2), sensor)
    # The share of near pixels across the edge is a normal distribution's; its spread is the noise's.
    share = (noisy < 1.4).mean(axis=0)
    columns = np.arange(79) + 0.5
    steps = np.diff(share)
    middle = np.sum(columns * steps)
    spread = np.sqrt(np.sum((columns - middle) ** 2 * steps))
    assert middle == pytest.approx(39.5, abs=0.1)
    # Whole pixels add a twelfth to the variance.
    assert spread == pytest.approx(np.hypot(lateral_deviation(np.zeros(1))[0], 12**-0.5), rel=0.1)


def test_deviations_grow_with_depth_and_beyond_sixty_degrees():
    at = np.deg2rad(np.array([0.0, 59.0, 70.0, 80.0]))
    deviation = axial_deviation(np.full(4, 1.0), at)
    assert deviation[0] == deviation[1] < deviation[2] < deviation[3]
    assert axial_deviation(np.array([2.0]), at[:1]) > axial_deviation(np.array([1.0]), at[:1])


def test_depth_comes_in_the_steps_of_the_disparity():
    depth = quantised(np.linspace(0.98, 1.02, 1000), KINECT.disparity_step)
    steps = np.diff(np.unique(depth))
    np.testing.assert_allclose(steps, 2.85e-3, rtol=0.05)
    assert quantised(np.zeros(3), KINECT.disparity_step).tolist() == [0, 0, 0]


def test_the_projector_leaves_a_shadow_on_one_side_only():
    depth = np.full((1, 400), 2.0)
    depth[0, 200:300] = 1.0
    shadow = projector_shadow(depth, 585.0, 0.075)[0]
    # Disparities differ by 585 * 0.075 * (1 / 1 - 1 / 2) = 21.9 pixels.
    assert np.flatnonzero(shadow).tolist() == list(range(179, 200))


def test_grazing_surfaces_are_not_measured():
    depth, shares = np.full((240, 320), 1.0), []
    for degrees in (50, 75, 86):
        cosine = np.full_like(depth, np.cos(np.deg2rad(degrees)))
        noisy = structured_light(depth, cosine, CAMERA, np.random.default_rng(3))
        shares.append((noisy > 0).mean())
    assert shares[0] > 0.99 and 0.4 < shares[1] < 0.6 and shares[2] < 0.01


def test_nothing_stays_nothing_and_the_same_seed_gives_the_same_image():
    depth = np.zeros((240, 320))
    depth[100:140, 100:160] = 0.7
    cosine = (depth > 0).astype(float)
    first, second = (
        structured_light(depth, cosine, CAMERA, np.random.default_rng(5)) for _ in range(2)
    )
    np.testing.assert_array_equal(first, second)
    assert not first[:90].any() and first[110:130, 110:150].any()


@pytest.mark.parametrize("step", [0.0, KINECT.disparity_step])
def test_without_noise_and_steps_depth_is_exact(step):
    depth = np.full((240, 320), 0.8)
    depth[:, 160:] = 1.1
    sensor = StructuredLight(disparity_step=step, baseline=0.0, speckle=0.0, noise=0.0)
    rng = np.random.default_rng(6)
    measured = structured_light(depth, np.ones_like(depth), CAMERA, rng, sensor)
    np.testing.assert_array_equal(measured, quantised(depth, step) if step else depth)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("noise", np.nan),
        ("noise", -1.0),
        ("noise", "much"),
        ("disparity_step", -0.1),
        ("baseline", np.inf),
        ("focal", 0.0),
        ("speckle", 1.5),
        ("near", -0.1),
        ("far", 0.2),
        ("grazing", (1.5, 1.0)),
        ("grazing", 1.0),
    ],
)
def test_figures_that_are_none_of_a_sensor_are_named(field, value):
    with pytest.raises(InputError, match=f"structured light: {field} is .*; expected"):
        replace(KINECT, **{field: value})
