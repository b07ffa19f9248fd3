"""Helper modules of these tests, and a JAX that compiles quickly rather than well."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version
from pathlib import Path

from packaging.version import Version

sys.path.insert(0, str(Path(__file__).parent))

# Read when JAX is imported, and when it first computes. Most tests compile longer than they run.
os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")
_FLAGS = "--xla_cpu_multi_thread_eigen=false"
if Version(version("jaxlib")) < Version("0.11"):
    # A third of the time to compile. Later ones end a process that sets it.
    _FLAGS += " --xla_cpu_use_fusion_emitters=false"
os.environ.setdefault("XLA_FLAGS", _FLAGS)
