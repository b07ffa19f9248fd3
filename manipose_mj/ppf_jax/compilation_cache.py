"""Compiled functions are kept between processes: compiling takes longer than an episode's estimates."""

from __future__ import annotations

import hashlib
import os
import platform
from pathlib import Path

import jax

from manipose_mj.storage.cache_root import cache_root

_VARIABLE, _OPTION = "JAX_COMPILATION_CACHE_DIR", "jax_compilation_cache_dir"
_WORTH_KEEPING = 0.2  # time to compile [s]


def keep_compiled() -> None:
    """From now on keep what JAX compiles in this package's cache, unless the user has said where or said no."""
    if _VARIABLE in os.environ or getattr(jax.config, _OPTION, None):
        return
    jax.config.update(_OPTION, str(cache_root() / "compiled" / _processor()))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", _WORTH_KEEPING)


def _processor() -> str:
    """A name for this processor: what is compiled for one may not run on another that shares the folder."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.is_file() else []
    flags = next((line for line in lines if line.startswith(("flags", "Features"))), "")
    text = f"{platform.machine()} {platform.processor()} {flags}"
    return hashlib.sha256(text.encode()).hexdigest()[:12]
