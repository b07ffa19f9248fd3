"""Commands that compile the estimator tell XLA not to tune fusions, unless their user says so."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from manipose_mj.console.process import compile_at_once_on_gpus

FLAG = "--xla_gpu_experimental_enable_fusion_autotuner"


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("", f"{FLAG}=false"),
        ("--xla_dump_to=/tmp/x", f"--xla_dump_to=/tmp/x {FLAG}=false"),
        (f"{FLAG}=true", f"{FLAG}=true"),
    ],
)
def test_a_user_s_word_stays(monkeypatch, before, after):
    monkeypatch.setenv("XLA_FLAGS", before)
    compile_at_once_on_gpus()
    assert os.environ["XLA_FLAGS"] == after


def test_the_installed_jax_knows_the_flag():
    # It ends a process whose XLA_FLAGS it does not know.
    script = "import jax; print(float(jax.jit(lambda x: x + 1)(1.0)))"
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"XLA_FLAGS": f"{FLAG}=false"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout.strip()) == (0, "2.0"), done.stderr
