"""A JAX that compiles quickly rather than well: these tests compile longer than they run."""

from __future__ import annotations

from collections.abc import Iterator

import jax
import pytest

_OPTION = "jax_disable_most_optimizations"


@pytest.fixture(scope="package", autouse=True)
def _quick_to_compile() -> Iterator[None]:
    before = jax.config.read(_OPTION)
    jax.config.update(_OPTION, True)
    yield
    jax.config.update(_OPTION, before)
