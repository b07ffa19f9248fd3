"""The ends of a body, from few points and from many."""

import numpy as np
import pytest

from manipose_mj.control.furniture.shapes.body_shape import body_slices, ends_of, front_of
from tests.control.furniture.synthetic import FRONT, HALF, HEIGHT, body, cloud, door, rectangle


def test_strays_are_not_ends():
    body = np.random.default_rng(0).uniform(-0.2, 0.2, (20_000, 3))
    low, high = ends_of(np.concatenate([body, [[0.9, 0.0, 0.0]]]))
    np.testing.assert_allclose([low, high], [[-0.2] * 3, [0.2] * 3], atol=0.01)


def test_where_points_are_few_all_count():
    apart = np.array([[0.0, 0.0, 0.0], [0.1, 0.2, 0.3], [0.3, 0.1, 0.2]])
    low, high = ends_of(apart)
    np.testing.assert_allclose([low, high], [[0.0] * 3, [0.3, 0.2, 0.3]], atol=0.011)


def test_a_body_that_does_not_show_is_one_box():
    bounds = np.array([[0.0, -0.3, 0.0], [0.4, 0.3, 0.8]])
    before_it = np.array([[0.6, 0.0, 0.4], [0.7, 0.1, 0.5]])
    np.testing.assert_allclose(body_slices(before_it, bounds), bounds[None])


def test_a_body_that_hardly_shows_is_one_box():
    bounds = np.array([[0.0, -0.3, 0.0], [0.4, 0.3, 0.8]])
    few = np.random.default_rng(0).uniform(bounds[0], bounds[1], (40, 3))
    np.testing.assert_allclose(body_slices(few, bounds), bounds[None])


@pytest.mark.parametrize("opening", [0.8, 1.5, 2.9])
def test_a_door_before_the_front_is_not_the_front(opening):
    found = front_of(cloud(body() + door(-HALF, opening, "outer inner")).points)
    assert found == pytest.approx(FRONT, abs=0.03)


def test_a_flap_before_the_front_is_not_the_front():
    x, y = np.eye(3)[:2]
    flap = rectangle(np.array([FRONT, -HALF, 0.1]), 0.4 * x, 2 * HALF * y, np.eye(3)[2])
    assert front_of(cloud([*body(), flap]).points) == pytest.approx(FRONT, abs=0.03)


def test_too_little_has_no_front():
    assert front_of(np.full((50, 3), HEIGHT)) is None
