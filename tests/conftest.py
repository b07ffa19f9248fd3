"""What every test runs under: one thread a process, and nothing written into the user's home."""

from __future__ import annotations

import gc
import math
import os
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest
from packaging.version import Version

from manipose_mj.console.process import keep_to_avx2
from tests import tiers
from tests.array_checks import install_array_checks

# Before NumPy loads: xdist gives every core a worker, and threads on top only slow each other down.
for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# Fewer tests depend on the processor.
keep_to_avx2()

# Shared by the workers and kept between runs, so that objects are built once.
_KEPT = Path(__file__).parents[1] / ".pytest_cache"
os.environ.setdefault("MANIPOSE_CACHE", str(_KEPT / "manipose-mj"))
os.environ.setdefault("MPLCONFIGDIR", str(_KEPT / "matplotlib"))
# Both workers compile much the same, and so does the next run. Read when JAX is imported.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(_KEPT / "jax"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.05")
# Compiled quickly rather than well, and kept from users of this checkout.
os.environ.setdefault("NUMBA_OPT", "0")
os.environ.setdefault("NUMBA_CACHE_DIR", str(_KEPT / "numba"))
# Read when JAX first computes.
_FLAGS = "--xla_cpu_multi_thread_eigen=false"
if Version(version("jaxlib")) < Version("0.11"):
    # Half the time to compile. Later ones end a process that sets it.
    _FLAGS += " --xla_cpu_use_fusion_emitters=false"
os.environ.setdefault("XLA_FLAGS", _FLAGS)

install_array_checks()


def pytest_configure(config: pytest.Config) -> None:
    """Declare the markers of the tiers."""
    for marker in tiers.MARKERS:
        config.addinivalue_line("markers", marker)


@pytest.hookimpl(tryfirst=True)  # before `-m` selects by what is marked here
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what samples leave out, and put long files first."""
    tiers.mark_left_out(items)
    tiers.order(items)


def pytest_collection_finish() -> None:
    """Search for garbage seldom, and not among what was imported: JAX makes much of it when it compiles."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


@pytest.fixture(autouse=True)
def _no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    """Progress shows after seconds, which a busy machine takes for what a quiet one does at once."""
    from manipose_mj.console import output

    monkeypatch.setattr(output, "QUIET_S", math.inf)


@pytest.fixture
def wrong_arrays() -> Iterator[None]:
    """Arrays that are not as declared reach the function, which is to refuse them itself."""
    from jaxtyping import config

    config.update("jaxtyping_disable", True)
    yield
    config.update("jaxtyping_disable", False)


@pytest.fixture
def optimised() -> Iterator[None]:
    """What JAX compiles is as quick as users have it, for estimators that compute longer than they compile."""
    import jax

    before = jax.config.read("jax_disable_most_optimizations")
    jax.config.update("jax_disable_most_optimizations", False)
    yield
    jax.config.update("jax_disable_most_optimizations", before)
