"""What a command sets up for its process and its workers before it loads NumPy or MuJoCo."""

from __future__ import annotations

import os
import platform
import threading
import time
from functools import cache
from pathlib import Path

from manipose_mj.errors import InputError

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

_PARENT_S = 1.0  # how often a worker looks for its parent


def one_thread_per_process() -> None:
    """Hold BLAS to one thread, as in the workers; no effect once NumPy is loaded.

    Episodes get their speed from `--jobs`, and sums must not depend on the number of threads.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


_CPU_INFO = Path("/proc/cpuinfo")


def keep_to_avx2() -> None:
    """Have BLAS and NumPy use no instructions beyond AVX2, on Linux on x86-64; no effect once NumPy is loaded, nor elsewhere.

    Both choose other instructions where a processor has more, which round differently in the last bits. What happens in
    a pile of objects can depend on them.
    """
    if platform.machine().lower() not in ("x86_64", "amd64") or not _CPU_INFO.is_file():
        return
    if " avx2 " in _CPU_INFO.read_text(encoding="utf-8", errors="replace"):
        os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")
        # As NumPy 2.4 names them; https://numpy.org/doc/stable/reference/simd/build-options.html
        os.environ.setdefault("NPY_DISABLE_CPU_FEATURES", "X86_V4 AVX512_ICL AVX512_SPR")


@cache
def end_with_parent() -> None:
    """Have this process, a worker, end within seconds of its parent's end, however that was killed."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_PARENT_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def prepare_workers(jobs: int) -> None:
    """`one_thread_per_process`, for a command that works on several things at the same time.

    Args:
      jobs: How many, as its `--jobs` says.

    Raises:
      InputError: None.
    """
    if jobs < 1:
        raise InputError(f"jobs is {jobs}; expected at least 1")
    one_thread_per_process()


_FUSION_AUTOTUNER = "--xla_gpu_experimental_enable_fusion_autotuner"


def compile_at_once_on_gpus() -> None:
    """Do without XLA's tuning of fusions on GPUs; no effect once JAX has begun to compile, nor where XLA_FLAGS says otherwise.

    On an H200 with JAX 0.11.2 it spent over five minutes on one reduction of the estimator; without it, the first step
    of a training comes after one. JAX 0.10.2 and 0.11.2 know the flag.
    """
    flags = os.environ.get("XLA_FLAGS", "")
    if _FUSION_AUTOTUNER not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {_FUSION_AUTOTUNER}=false".strip()
