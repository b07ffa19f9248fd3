"""The ends of a body, from few points and from many."""

import numpy as np

from manipose_mj.control.furniture.body_shape import ends_of


def test_strays_are_not_ends():
    body = np.random.default_rng(0).uniform(-0.2, 0.2, (20_000, 3))
    low, high = ends_of(np.concatenate([body, [[0.9, 0.0, 0.0]]]))
    np.testing.assert_allclose([low, high], [[-0.2] * 3, [0.2] * 3], atol=0.01)


def test_where_points_are_few_all_count():
    apart = np.array([[0.0, 0.0, 0.0], [0.1, 0.2, 0.3], [0.3, 0.1, 0.2]])
    low, high = ends_of(apart)
    np.testing.assert_allclose([low, high], [[0.0] * 3, [0.3, 0.2, 0.3]], atol=0.011)
