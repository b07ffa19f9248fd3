"""Sums of a few terms instead of calls of a library."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.small_matrices import (
    product,
    product_with_vector,
    solve_positive,
    squared_length,
    sum_of_squares,
)


@pytest.mark.parametrize(
    "shapes", [((5, 4, 4), (5, 4, 4)), ((2, 1, 3, 3), (7, 3, 3)), ((6, 7), (7, 6))]
)
def test_products_are_those_of_numpy(shapes):
    rng = np.random.default_rng(0)
    a, b = (rng.normal(size=shape).astype(np.float32) for shape in shapes)
    np.testing.assert_allclose(product(jnp.asarray(a), jnp.asarray(b)), a @ b, atol=1e-5)
    np.testing.assert_array_equal(product(a, b), a @ b)


def test_solutions_solve():
    rng = np.random.default_rng(1)
    roots = rng.normal(size=(50, 6, 8))
    matrices, right = roots @ np.swapaxes(roots, 1, 2) + 0.1 * np.eye(6), rng.normal(size=(50, 6))
    expected = np.linalg.solve(matrices, right[..., None])[..., 0]
    found = jax.vmap(solve_positive)(*(jnp.asarray(x, jnp.float32) for x in (matrices, right)))
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-4)
    np.testing.assert_array_equal(
        solve_positive(matrices[0], right[0]), np.linalg.solve(matrices[0], right[0])
    )


def test_vectors_and_squares():
    rng = np.random.default_rng(2)
    a, vector = rng.normal(size=(7, 6)).astype(np.float32), rng.normal(size=6).astype(np.float32)
    np.testing.assert_allclose(
        product_with_vector(jnp.asarray(a), jnp.asarray(vector)), a @ vector, atol=1e-5
    )
    np.testing.assert_array_equal(product_with_vector(a, vector), a @ vector)
    assert squared_length(vector) == vector @ vector
    assert float(squared_length(jnp.asarray(vector))) == pytest.approx(
        float(vector @ vector), rel=1e-5
    )
    values = rng.normal(size=(4, 3, 3))
    np.testing.assert_allclose(
        sum_of_squares(jnp.asarray(values), axes=2), (values**2).sum((1, 2)), rtol=1e-5
    )
    np.testing.assert_array_equal(sum_of_squares(values, axes=2), np.sum(values**2, axis=(-2, -1)))
