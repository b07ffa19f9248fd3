"""Evaluations of policies that end early and go on: lost servers, other metadata, other widths."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from threading import Thread
from typing import Any

import pytest
from websockets.sync.server import serve as websocket_server

from manipose_mj.cli.main import main
from manipose_mj.errors import InputError, ServerLostError
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.records import read_results
from manipose_mj.evaluation.results_folder import RUN_FILE
from manipose_mj.evaluation.runner import PolicyRunner, evaluate, run_one
from manipose_mj.policies.loading import load_policy
from manipose_mj.wire.framing import pack
from tests.evaluation.test_policies import HERE, REACHING, TASK, evaluation, timeless
from tests.few_objects import few
from tests.places import ROOT


@contextmanager
def process_serving(name: str, port: int = 0) -> Iterator[str]:
    """The address of a policy in a process of its own."""
    command = [sys.executable, "-m", HERE, name, str(port)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
    finally:
        process.kill()
        process.wait()


def test_a_server_lost_in_the_middle_can_be_resumed(tmp_path, capsys):
    out = tmp_path / "out"
    with process_serving("Dying") as address:
        lost = evaluation(out, replace(REACHING, name=address))
        with pytest.raises(ServerLostError, match="repeat with --resume"):
            evaluate(lost)
    assert len(read_results(out / "results.jsonl")[0]) == 2
    load_policy.cache_clear()
    words = ["evaluate", TASK, "--episodes", "4", "--jobs", "1", "--out", str(out), "--resume"]
    words += ["--policy", address, "--objects", *few(TASK)]
    assert main(words) == 2
    assert "no policy server answers there" in capsys.readouterr().err
    with process_serving("Reaching", int(address.rpartition(":")[2])):
        evaluate(lost, resume=True)
    evaluate(evaluation(tmp_path / "whole", REACHING))
    assert timeless(out) == timeless(tmp_path / "whole")


@contextmanager
def greeting_once() -> Iterator[str]:
    """The address of a server that goes away when it has told somebody its metadata."""

    def converse(connection: Any) -> None:
        connection.send(pack({"manipose_reset": True}))
        Thread(target=server.shutdown).start()  # which waits for this function

    server = websocket_server(converse, "localhost", 0, compression=None)
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"ws://localhost:{server.socket.getsockname()[1]}"
    server.shutdown()
    thread.join(5)


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.full)])
def test_a_lost_server_is_exit_code_1_also_where_a_worker_never_met_it(jobs, tmp_path, capsys):
    out = tmp_path / "out"
    with greeting_once() as address:
        words = ["evaluate", TASK, "--episodes", "2", "--jobs", str(jobs), "--out", str(out)]
        assert main([*words, "--policy", address, "--objects", *few(TASK)]) == 1
    (said,) = capsys.readouterr().err.splitlines()
    assert "the policy server" in said or "no policy server answers" in said
    assert "start it again and repeat with --resume" in said
    assert (out / RUN_FILE).is_file() and not read_results(out / "results.jsonl")[0]


def test_a_worker_that_finds_no_server_has_lost_it(tmp_path):
    gone = replace(REACHING, name="ws://localhost:9")
    with pytest.raises(ServerLostError, match="no policy server answers .*repeat with --resume"):
        run_one(evaluation(tmp_path, gone), PolicyRunner(gone, tmp_path), TASK, 0)


def test_resume_refuses_the_results_of_another_policy(tmp_path):
    settings = PolicySettings(f"{HERE}:answering_nan")
    evaluate(evaluation(tmp_path, settings, episodes=1))
    for other in (REACHING, replace(settings, hz=20.0)):
        with pytest.raises(InputError, match="its results have policy "):
            evaluate(evaluation(tmp_path, other, episodes=1), resume=True)


def test_resume_refuses_what_a_server_with_other_metadata_left(tmp_path, monkeypatch):
    evaluate(evaluation(tmp_path, REACHING, episodes=1))
    served = load_policy(REACHING.name, REACHING.arguments)
    monkeypatch.setattr(served, "metadata", {"checkpoint": "b", "seen": float("inf")})
    with pytest.raises(InputError, match="its results have policy metadata "):
        evaluate(evaluation(tmp_path, REACHING, episodes=2), resume=True)
    evaluate(evaluation(tmp_path / "new", REACHING, episodes=1))
    said = json.loads((tmp_path / "new" / RUN_FILE).read_text())["policy metadata"]
    assert said == {"checkpoint": "b", "seen": "inf"}


def test_resume_goes_on_with_a_server_that_was_started_again(tmp_path, monkeypatch, caplog):
    served = load_policy(REACHING.name, REACHING.arguments)
    same = {"name": "reaching", "host": "a"}
    for episodes, metadata in enumerate((same, same, {"name": "reaching", "pid": 7}), start=1):
        monkeypatch.setattr(served, "metadata", metadata)
        caplog.clear()
        evaluate(evaluation(tmp_path, REACHING, episodes=episodes), resume=True)
        assert json.loads((tmp_path / RUN_FILE).read_text())["policy metadata"] == metadata
        said = [each for each in caplog.messages if "metadata" in each]
        assert said == [f"{tmp_path}: other policy metadata than before: host, pid"] * (
            episodes == 3
        )
    assert len(timeless(tmp_path)) == 3


def test_actions_of_another_width_in_a_later_episode_are_a_failure(tmp_path):
    settings = PolicySettings(f"{HERE}:Narrowing")
    load_policy.cache_clear()
    results = evaluate(evaluation(tmp_path, settings, episodes=2))
    assert [each.failure for each in results] == ["release", "policy"]
    assert "have shape (1, 7); expected (t, 8)" in results[1].reason
    load_policy.cache_clear()  # as in a process of its own, whose first answer is narrow
    load_policy(settings.name, None).after = 0
    resumed = evaluate(evaluation(tmp_path, settings, episodes=3), resume=True)
    assert [each.failure for each in resumed] == ["release", "policy", "policy"]
