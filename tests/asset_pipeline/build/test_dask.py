"""The same build on one machine's processes and on a cluster of dask.distributed: equal files."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import joblib
import pytest

import tests.asset_pipeline.scan_files as files
from asset_pipeline.build.data_set import build
from manipose_mj.cli.main import main

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")
SOURCE = "google_scanned_objects"


def _hashes(folder: Path) -> dict[str, str]:
    return {
        p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


@pytest.fixture(scope="module")
def scans(tmp_path_factory) -> Path:
    """Two objects that can be built, and one that cannot."""
    box = files.box((0.2, 0.25, 0.3))  # too wide to grasp: quick
    content = {f"models/{n}/model.obj": files.obj(box) for n in ("Blue_Box", "Green_Box")}
    content["models/Torn_Box/model.obj"] = files.obj(box)[:200]
    return files.write_folder(tmp_path_factory.mktemp("dask_scans"), content)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Two workers, processes as on a real cluster."""
    folder = tmp_path_factory.mktemp("dask_cluster")
    with (
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            local_directory=str(folder),
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def test_dask_builds_the_same_files_as_one_machine(cluster, scans, tmp_path):
    here = build(SOURCE, scans, tmp_path / "here")
    seen = []
    with joblib.parallel_config(backend="dask"):
        there = build(SOURCE, scans, tmp_path / "there", progress=lambda r, n: seen.append(r.name))
    expected = ["built", "built", "failed"]
    assert [r.status for r in here] == [r.status for r in there] == expected
    assert here[2].reason == there[2].reason and "Torn_Box" in here[2].reason
    assert sorted(seen) == [r.name for r in there]
    assert _hashes(tmp_path / "there") == _hashes(tmp_path / "here")
    assert {p.name for p in (tmp_path / "there").iterdir()} == {"Blue_Box", "Green_Box"}


def test_command_uses_the_cluster_it_is_given(cluster, scans, tmp_path, capsys):
    address = cluster.scheduler_info()["address"]
    ran = cluster.run(os.getpid)
    command = ["assets", "build", SOURCE, str(scans), "--out", str(tmp_path), "--dask", address]
    assert main([*command, "--only", "Torn_Box"]) == 2
    assert "0 built, 0 up to date, 1 failed" in capsys.readouterr().out
    assert cluster.run(os.getpid) == ran  # the workers live


def test_no_scheduler_is_one_line(scans, tmp_path, capsys):
    command = ["assets", "build", SOURCE, str(scans), "--out", str(tmp_path)]
    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}):
        assert main([*command, "--dask", "tcp://127.0.0.1:9"]) == 2
    error = capsys.readouterr().err
    assert "no scheduler answers" in error and "127.0.0.1:9" in error
