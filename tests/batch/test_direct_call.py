"""Functions that JAX calls without copies."""

from __future__ import annotations

import gc
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.batch.kernels.direct_call import DirectCall

SHAPES = (jax.ShapeDtypeStruct((2, 3), jnp.float32), jax.ShapeDtypeStruct((2,), jnp.bool_))


def doubled(values: np.ndarray, counts: np.ndarray, twice: np.ndarray, many: np.ndarray) -> None:
    twice[:] = 2 * values
    many[:] = counts > 1


def test_a_function_writes_what_jax_gets():
    call, values = DirectCall(doubled, SHAPES), jnp.arange(6, dtype=jnp.float32).reshape(2, 3)
    counts = jnp.array([1, 2], jnp.int32)
    for function in (call, jax.jit(call), jax.jit(call._copied)):
        twice, many = function(values, counts)
        np.testing.assert_array_equal(twice, 2 * values)
        assert many.tolist() == [False, True]


def test_it_is_called_in_every_step_of_a_scan():
    seen = []

    def count(before: np.ndarray, after: np.ndarray) -> None:
        seen.append(int(before[0]))
        after[:] = before + 1

    call = DirectCall(count, [jax.ShapeDtypeStruct((1,), jnp.int32)])

    def step(carry, _):
        (after,) = call(carry)
        return after, after

    last, all_of_them = jax.jit(lambda first: jax.lax.scan(step, first, None, length=5))(
        jnp.zeros(1, jnp.int32)
    )
    assert seen == [0, 1, 2, 3, 4] and last.tolist() == [5]
    assert all_of_them[:, 0].tolist() == [1, 2, 3, 4, 5]


def test_what_it_raises_is_told():
    def refuse(*_: np.ndarray) -> None:
        raise ValueError("no such world")

    call = DirectCall(refuse, SHAPES[:1])
    with pytest.raises(jax.errors.JaxRuntimeError, match="ValueError: no such world"):
        jax.block_until_ready(jax.jit(call)(jnp.zeros(2)))


def test_a_compiled_function_that_outlives_it_says_so():
    compiled = jax.jit(DirectCall(doubled, SHAPES)).lower(jnp.zeros((2, 3)), jnp.zeros(2)).compile()
    jax.clear_caches()
    gc.collect()
    with pytest.raises(jax.errors.JaxRuntimeError, match="keep its worlds as long as it"):
        jax.block_until_ready(compiled(jnp.zeros((2, 3)), jnp.zeros(2)))


def test_a_program_that_ends_waits_for_a_call_that_nobody_waits_for():
    program = """
import time, jax, jax.numpy as jnp
from manipose_mj.batch.kernels.direct_call import DirectCall

def slow(before, after):
    time.sleep(0.5)
    after[:] = before

call = DirectCall(slow, [jax.ShapeDtypeStruct((300, 300), jnp.float32)])
result = jax.jit(lambda x: call(x @ x))(jnp.ones((300, 300)))
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)
