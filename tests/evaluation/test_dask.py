"""The same evaluation on one machine's processes and on a cluster of dask.distributed: equal records."""

from __future__ import annotations

import json
from pathlib import Path
from threading import Lock

import pytest

import tests.evaluation.fake_episodes as fake
from manipose_mj.cli.main import main
from manipose_mj.console import cluster as console_cluster
from manipose_mj.errors import InputError
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.records import trajectory_path
from manipose_mj.evaluation.runner import evaluate
from tests.evaluation.test_runner import timeless

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")
ADDRESS_OF_NOBODY = "tcp://127.0.0.1:9"


def _cluster(folder: Path, workers: int):
    """In this process; two threads a worker, as `dask worker` has by default."""
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=2,
        processes=False,
        protocol="tcp",
        dashboard_address=":0",
        local_directory=str(folder),
    )


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Of a scheduler with one worker."""
    with _cluster(tmp_path_factory.mktemp("dask_cluster"), 1) as cluster:
        yield cluster.scheduler_address


_running = Lock()


def _exclusive(config, spec, *, episode, pose):
    """Fails where two episodes of one process run at the same time."""
    assert _running.acquire(blocking=False)
    try:
        return fake.make_runner(0.01)(config, spec, episode=episode, pose=pose)
    finally:
        _running.release()


def _config(out: Path, **changes) -> EvaluationConfig:
    return EvaluationConfig(fake.TASKS, out, episodes=4, **changes)


def test_results_on_a_cluster_are_those_of_one_machine(address, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    here, there = Path("here"), Path("there")
    evaluate(_config(here), runner=fake.make_runner())
    done = []
    evaluate(
        _config(there, dask=address),
        runner=_exclusive,
        on_progress=lambda results, total: done.append(len(results)),
    )
    assert done == list(range(9))
    assert timeless(there / "results.jsonl") == timeless(here / "results.jsonl")
    for path in (trajectory_path(here, task, e) for task in fake.TASKS for e in range(4)):
        assert (there / path.relative_to(here)).read_bytes() == path.read_bytes()


def test_one_missing_episode_runs_on_the_cluster_too(address, tmp_path):
    evaluate(_config(tmp_path / "whole"), runner=fake.make_runner())
    config = _config(tmp_path / "out", dask=address)
    evaluate(config, runner=_exclusive)
    lines = (config.out / "results.jsonl").read_bytes().splitlines(keepends=True)
    (config.out / "results.jsonl").write_bytes(b"".join(lines[:-1]))
    evaluate(config, runner=_exclusive, resume=True)
    assert timeless(config.out / "results.jsonl") == timeless(tmp_path / "whole/results.jsonl")
    assert address in json.loads((config.out / "run.json").read_text())["command"]


def test_workers_elsewhere_find_the_folders_of_objects(address, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").mkdir()
    seen = tmp_path / "seen"

    def look(config, spec, *, episode, pose):
        seen.write_text(" ".join(config.objects))
        return fake.make_runner()(config, spec, episode=episode, pose=pose)

    config = EvaluationConfig(
        fake.TASKS[:1], Path("out"), episodes=1, objects=("mug_000", "mine"), dask=address
    )
    evaluate(config, runner=look)
    assert seen.read_text() == f"mug_000 {tmp_path / 'mine'}"


def test_wrong_input_in_an_episode_ends_the_evaluation(address, tmp_path):
    def refuse(config, spec, *, episode, pose):
        raise InputError("the object is too wide")

    with pytest.raises(InputError, match="too wide"):
        evaluate(_config(tmp_path, dask=address), runner=refuse)


@pytest.mark.full
def test_the_command_plays_the_same_real_episodes(address, tmp_path, capsys):
    command = ["evaluate", "single_object/target_pose", "--episodes", "2", "--objects", "mug_000"]
    assert main([*command, "--out", str(tmp_path / "here"), "--jobs", "2"]) == 0
    assert main([*command, "--out", str(tmp_path / "there"), "--dask", address]) == 0
    here, there = (timeless(tmp_path / each / "results.jsonl") for each in ("here", "there"))
    assert here == there and len(here) == 2


@pytest.mark.parametrize("wrong", [ADDRESS_OF_NOBODY, "nowhere", "what://127.0.0.1:9"])
def test_a_wrong_address_is_one_line_and_writes_nothing(tmp_path, capsys, wrong):
    out = tmp_path / "out"
    command = ["evaluate", fake.TASKS[0], "--out", str(out), "--dask", wrong]
    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}):
        assert main(command) == 2
    error = capsys.readouterr().err
    assert f"--dask {wrong}: no scheduler answers" in error and len(error.splitlines()) == 1
    assert not out.exists()


def test_a_scheduler_without_workers_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(console_cluster, "WAIT_FOR_WORKERS", 0.1)
    with (
        _cluster(tmp_path / "dask", 0) as empty,
        pytest.raises(InputError, match=r"no worker within 0.1 s"),
    ):
        evaluate(_config(tmp_path / "out", dask=empty.scheduler_address))
    assert not (tmp_path / "out").exists()
