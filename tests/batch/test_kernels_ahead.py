"""Kernels are found without being launched, and compiled by other processes for a GPU that is not there."""

from __future__ import annotations

import logging

import pytest

wp = pytest.importorskip("warp", reason='needs pip install -e ".[gpu]"')

from manipose_mj.batch.kernels import kernels_ahead  # noqa: E402
from tests.batch import small_kernels  # noqa: E402


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty one."""
    wp.init()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    monkeypatch.setattr(kernels_ahead, "CORES", 2)
    return tmp_path


def test_a_dry_run_finds_every_kernel_and_computes_nothing():
    made = []
    found = kernels_ahead.launches(lambda size: made.append(small_kernels.launch_all(size)), (3,))
    assert {one.module for one in found} == {kernel.module for kernel in small_kernels.KERNELS}
    assert sorted(one.block_dim for one in found) == [64, 256, 256, 256, 256]
    assert made[0].numpy().tolist() == [0.0, 0.0, 0.0]


def test_other_processes_compile_what_the_cache_lacks(cache, caplog):
    begin = small_kernels.launch_all, (3,), 90, "alike"
    compiling = kernels_ahead.begin_compiling(*begin)
    assert compiling is not None
    with caplog.at_level(logging.INFO):
        compiling.wait()
    assert "by 2 processes" in caplog.text and "failed" not in caplog.text
    for kernel in small_kernels.KERNELS:
        block_dim = 64 if kernel is small_kernels.KERNELS[-1] else 256
        name = kernels_ahead.Launch(kernel.module, block_dim).name
        assert (cache / name / f"{name}.sm90.cubin").is_file()
    assert kernels_ahead.begin_compiling(*begin) is None


def test_a_process_that_fails_is_reported_and_no_more(cache, caplog):
    compiling = kernels_ahead.Compiling(b"nothing", 1)
    compiling.wait()
    assert "1 of 1 processes that compile kernels failed" in caplog.text
