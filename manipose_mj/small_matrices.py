"""Products and solutions of matrices of a few rows, quick for many worlds at once as well.

NumPy does what it always does. XLA calls a library for each product or solution, which takes longer than all else: here
it gets sums of a few terms, which it fuses with what is around them. What has no leading dimensions is for `jax.vmap`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

Array = Any  # a NumPy or a JAX array


def product(a: Float[Array, "*#b n k"], b: Float[Array, "*#b k m"]) -> Array:
    """`a @ b`."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a @ b
    return sum(a[..., :, i, None] * b[..., None, i, :] for i in range(a.shape[-1]))


def product_with_vector(a: Float[Array, "n k"], vector: Float[Array, " k"]) -> Array:
    """`a @ vector`."""
    if isinstance(a, np.ndarray) and isinstance(vector, np.ndarray):
        return a @ vector
    return product(a, vector[:, None])[:, 0]


def squared_length(vector: Float[Array, " n"]) -> Array:
    """`vector @ vector`."""
    return vector @ vector if isinstance(vector, np.ndarray) else sum_of_squares(vector)


def sum_of_squares(values: Float[Array, "*b"], axes: int = 1) -> Array:
    """Over the last axes."""
    squares: Any = values**2
    if isinstance(squares, np.ndarray | np.generic):
        return np.sum(squares, axis=tuple(range(-axes, 0)))
    for _ in range(axes):
        squares = sum(squares[..., i] for i in range(squares.shape[-1]))
    return squares


def solve_positive(matrix: Float[Array, "n n"], right: Float[Array, " n"]) -> Array:
    """The solution of `matrix @ x = right` for a symmetric, positive definite matrix (Cholesky).

    In single precision its smallest eigenvalue has to be above some 1e-6 of its largest.
    """
    if isinstance(matrix, np.ndarray):
        return np.linalg.solve(matrix, right)
    import jax.numpy as jnp

    size = matrix.shape[-1]
    lower: list[list[Array]] = []
    for i in range(size):
        row: list[Array] = []
        for j in range(i):
            left = matrix[i, j] - sum(row[k] * lower[j][k] for k in range(j))
            row.append(left / lower[j][j])
        row.append(jnp.sqrt(matrix[i, i] - sum(value**2 for value in row)))
        lower.append(row)
    forward: list[Array] = []
    for i in range(size):
        left = right[i] - sum(lower[i][k] * forward[k] for k in range(i))
        forward.append(left / lower[i][i])
    found: list[Array] = [None] * size
    for i in reversed(range(size)):
        left = forward[i] - sum(lower[k][i] * found[k] for k in range(i + 1, size))
        found[i] = left / lower[i][i]
    return jnp.stack(found)
