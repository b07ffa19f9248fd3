"""Which instructions a command asks of BLAS and NumPy, as others round differently."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

from manipose_mj.console import process

NAMES = ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES")
TOLD = """
from manipose_mj.console.process import keep_to_avx2
keep_to_avx2()
from numpy._core._multiarray_umath import __cpu_dispatch__ as known, __cpu_features__ as found
print([name for name in known if found[name]])
"""


@pytest.fixture(autouse=True)
def _unset(monkeypatch):
    for name in NAMES:
        monkeypatch.setenv(name, "")  # restored afterwards
        monkeypatch.delenv(name)


@pytest.mark.skipif(platform.machine() != "x86_64", reason="there are no such instructions")
def test_numpy_uses_no_more_than_avx2():
    done = subprocess.run(
        [sys.executable, "-c", TOLD],
        capture_output=True,
        text=True,
        check=True,
        env=dict(os.environ),
    )
    assert done.stdout.strip() in ("[]", "['X86_V3']")


@pytest.mark.parametrize(
    ("machine", "flags", "set_"),
    [("x86_64", "fma avx2 bmi", True), ("x86_64", "sse4_2 avx", False), ("arm64", "avx2", False)],
)
def test_only_processors_with_avx2_are_told(monkeypatch, tmp_path, machine, flags, set_):
    info = tmp_path / "cpuinfo"
    info.write_text(f"flags : fpu {flags} sha_ni\n")
    monkeypatch.setattr(process, "_CPU_INFO", info)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    process.keep_to_avx2()
    assert [name in os.environ for name in NAMES] == [set_, set_]


def test_what_users_say_stays(monkeypatch):
    monkeypatch.setenv(NAMES[0], "Zen")
    process.keep_to_avx2()
    assert os.environ[NAMES[0]] == "Zen"
