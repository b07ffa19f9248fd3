"""The ends of a body, from few points and from many."""

import numpy as np

from manipose_mj.control.furniture.shapes.body_shape import body_slices, ends_of


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
