"""What a command sets up for its process and its workers before it loads NumPy or MuJoCo."""

from __future__ import annotations

import os
import warnings

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def one_thread_per_process() -> None:
    """Hold BLAS to one thread, as in the workers; no effect once NumPy is loaded.

    Episodes get their speed from `--jobs`, and sums must not depend on the number of threads.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def hush_glfw() -> None:
    """Keep quiet that there is no display: dm_control tries one as it is imported, also in workers."""
    warnings.filterwarnings("ignore", module="glfw")
    os.environ.setdefault("PYTHONWARNINGS", "ignore:::glfw")
