"""What is compiled for the estimators is kept between processes, where the user has not said otherwise."""

from __future__ import annotations

import jax
import pytest

from manipose_mj.ppf_jax.compilation_cache import keep_compiled


@pytest.fixture
def nowhere(monkeypatch, tmp_path):
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", None)
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path))
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)


def test_compiled_functions_are_kept_in_the_cache_of_the_package(nowhere):
    keep_compiled()
    kept = jax.config.jax_compilation_cache_dir
    assert kept is not None and kept.startswith(str(nowhere / "compiled"))


def test_the_users_own_place_is_left_alone(nowhere, monkeypatch):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "elsewhere")
    keep_compiled()
    assert jax.config.jax_compilation_cache_dir is None
