"""What every test runs under: one thread a process, and nothing written into the user's home."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

# Before NumPy loads: xdist gives every core a worker, and threads on top only slow each other down.
for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# Shared by the workers and kept between runs, so that objects are built once.
_KEPT = Path(__file__).parents[1] / ".pytest_cache"
os.environ.setdefault("MANIPOSE_CACHE", str(_KEPT / "manipose-mj"))
os.environ.setdefault("MPLCONFIGDIR", str(_KEPT / "matplotlib"))
# Both workers compile much the same, and so does the next run. Read when JAX is imported.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(_KEPT / "jax"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.3")

# Files whose tests take long though they are few.
_LONG = (
    "test_shipped_furniture",
    "test_shipped_weights",
    "test_training",
    "test_shipped_types",
    "test_pose_table",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files first, then those of many tests, so that the workers end at about the same time.

    In the order that pytest-xdist would choose itself, a file of one test comes last, however long it takes.
    """
    tests = Counter(item.path for item in items)
    items.sort(key=lambda item: (item.path.stem not in _LONG, -tests[item.path], item.path))


@pytest.fixture
def optimised() -> Iterator[None]:
    """What JAX compiles is as quick as users have it, for estimators that compute longer than they compile."""
    import jax

    before = jax.config.read("jax_disable_most_optimizations")
    jax.config.update("jax_disable_most_optimizations", False)
    yield
    jax.config.update("jax_disable_most_optimizations", before)
