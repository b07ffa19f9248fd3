"""The noise of rendered planes follows Nguyen et al. 2012 and Khoshelham & Elberink 2012 within 10 %."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from manipose_mj.mjcf.cameras.depth_noise import KINECT, Measured, StructuredLight, measure
from manipose_mj.mjcf.cameras.ray_camera import RayCamera, RayImage, camera_intrinsics

# A board that a camera with the Kinect's focal length, 585 pixels, looks at from 1 m above the origin.
HEIGHT, WIDTH = 240, 320
FOVY = 2 * np.degrees(np.arctan(HEIGHT / 2 / KINECT.focal))
# Tilted, or the compiler would take its frame for the world's and never look at it again.
SCENE = f"""<mujoco><worldbody>
  <camera name="eye" pos="0 0 1" fovy="{FOVY}"/>
  <geom name="board" type="box" size="9 9 .01" pos="0 0 -.01" euler="0 9 0"/>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def scene() -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(SCENE)
    return model, mujoco.MjData(model)


def _board(scene, distance: float, degrees: float, seed: int) -> tuple[RayImage, Measured]:
    """The rendered board at this distance, turned about the camera's y, and its measurement."""
    model, data = scene
    angle = np.radians(degrees)
    model.geom_quat[0] = [np.cos(angle / 2), 0, np.sin(angle / 2), 0]
    # The upper face stays in the optical axis at that distance.
    model.geom_pos[0] = np.array([0, 0, 1 - distance]) - 0.01 * np.array(
        [np.sin(angle), 0, np.cos(angle)]
    )
    mujoco.mj_forward(model, data)
    image = RayCamera(HEIGHT, WIDTH).render(model, data, "eye")
    k = camera_intrinsics(model, "eye", HEIGHT, WIDTH)
    rays = np.concatenate([k.slopes() * [1, -1], -np.ones((HEIGHT, WIDTH, 1))], axis=-1)
    cosine = -np.sum(image.normal * rays, axis=-1) / np.linalg.norm(rays, axis=-1)
    rng = np.random.default_rng(seed)
    return image, measure(image.depth.astype(float), cosine, k, rng)


def _axial(distance: float, degrees: float) -> float:
    """Equations 2 and 3 of Nguyen et al., written down from the paper once more."""
    theta = np.radians(degrees)
    sigma = 0.0012 + 0.0019 * (distance - 0.4) ** 2
    if degrees > 60:
        sigma += 0.0001 / np.sqrt(distance) * theta**2 / (np.pi / 2 - theta) ** 2
    return sigma


@pytest.mark.parametrize("degrees", [0, 30, 55, 72])
@pytest.mark.parametrize("distance", [0.5, 0.9, 1.5, 2.5])
def test_axial_noise_of_a_rendered_board_is_the_sources(scene, distance, degrees):
    image, noisy = _board(scene, distance, degrees, seed=1)
    # A strip around the axis, where depth and angle are those asked for.
    middle = np.abs(image.depth - distance) < 0.02 * distance
    middle &= np.abs(np.arange(WIDTH) - WIDTH / 2) < 12
    seen = middle & (noisy.depth > 0)
    assert seen.sum() > 800
    error = (noisy.depth - image.depth)[seen]
    assert np.std(error) == pytest.approx(_axial(distance, degrees), rel=0.1)
    assert abs(np.mean(error)) < 0.1 * _axial(distance, degrees)


@pytest.mark.parametrize("distance", [0.7, 1.4, 3.0])
def test_depth_comes_in_the_sources_steps(scene, distance):
    _, noisy = _board(scene, distance, 0, seed=2)
    steps = np.diff(np.unique(noisy.depth[noisy.depth > 0]))
    # Khoshelham & Elberink: neighbouring disparities are 2.85e-3 / m times depth squared apart.
    assert steps.min() > 0.8 * 2.85e-3 * distance**2
    assert np.median(steps) == pytest.approx(2.85e-3 * distance**2, rel=0.1)


def test_a_step_of_disparity_is_an_eighth_of_a_pixel():
    # 1 / (focal * baseline) is what a whole pixel of disparity changes in inverse depth.
    assert KINECT.disparity_step * KINECT.focal * KINECT.baseline == pytest.approx(1 / 8, rel=0.02)


def test_dropouts_grow_towards_grazing_angles(scene):
    shares = []
    for degrees in (0, 60, 70, 78, 84):
        image, noisy = _board(scene, 0.8, degrees, seed=3)
        middle = np.abs(np.arange(WIDTH) - WIDTH / 2) < 3
        shares.append(np.mean(noisy.depth[:, middle] > 0))
    assert shares[0] > 0.99 and shares[1] > 0.98
    assert shares[1] > shares[2] > shares[3] > shares[4] and shares[4] < 0.2


def test_what_is_too_near_or_too_far_is_not_measured(scene):
    for distance, seen in ((0.3, False), (0.4, True), (4.5, True), (6.0, False)):
        _, noisy = _board(scene, distance, 0, seed=4)
        assert (np.mean(noisy.depth > 0) > 0.5) == seen, distance


def test_other_images_move_their_edges_with_the_depth():
    depth = np.full((200, 60), 2.0)
    depth[:, 30:] = 0.8
    ids = (depth < 1).astype(int)
    k = camera_intrinsics(mujoco.MjModel.from_xml_string(SCENE), "eye", 200, 60)
    sensor = StructuredLight(baseline=0.0, speckle=0.0)
    noisy = measure(depth, np.ones_like(depth), k, np.random.default_rng(5), sensor)
    moved = noisy.moved(ids)
    np.testing.assert_array_equal(moved == 1, noisy.depth < 1.4)
    assert (moved != ids).any() and (moved == ids)[:, np.r_[0:26, 34:60]].all()
