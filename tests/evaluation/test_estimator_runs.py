"""An evaluation with somebody's estimator: what its results belong to, and what a lost server leaves."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import tests.evaluation.fake_episodes as fake
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError, ServerLostError
from manipose_mj.estimators.answer import EstimatorFailedError
from manipose_mj.estimators.loading import load_estimator
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.episode import traceback_of
from manipose_mj.evaluation.records import read_results
from manipose_mj.evaluation.runner import BaselineRunner, evaluate, run_one
from manipose_mj.failures import StageFailure
from tests.estimators.answers import Raises
from tests.few_objects import few
from tests.wire.answering import answering

TASK = "single_object/target_pose"
MIDDLE = EstimatorSettings("tests.estimators.answers:Middle", '{"score": 0.5}', give_cad=True)


def config(out: Path, estimator: EstimatorSettings | None = MIDDLE) -> EvaluationConfig:
    return EvaluationConfig(
        (TASK,), out, episodes=4, pose="estimated" if estimator else "oracle", estimator=estimator
    )


def test_results_say_whose_estimates_they_are_of(tmp_path):
    evaluate(config(tmp_path), runner=fake.make_runner())
    told = {"name": MIDDLE.name, "arguments": {"score": 0.5}, "given CAD": True}
    run, summary = (json.loads((tmp_path / f"{n}.json").read_text()) for n in ("run", "summary"))
    assert run["estimator"] == summary["estimator"] == told
    assert run["masks"] == summary["masks"] == "oracle"
    assert summary["poses"]["objects"] == f"estimated by {MIDDLE.name}, given CAD"
    assert "--give-cad" in run["command"] and "--estimator-args" in run["command"]
    with pytest.raises(InputError, match="its results have estimator"):
        evaluate(
            config(tmp_path, EstimatorSettings(MIDDLE.name)), resume=True, runner=fake.make_runner()
        )


def test_a_server_lost_in_the_middle_is_no_failed_episode_and_can_be_resumed(tmp_path):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    evaluate(config(whole), runner=fake.make_runner())

    def lost_at_2(config, spec, *, episode, pose):
        if episode == 2:
            raise ServerLostError("ws://there: connection lost")
        return fake.make_runner()(config, spec, episode=episode, pose=pose)

    with pytest.raises(ServerLostError):
        evaluate(config(broken), runner=lost_at_2)
    assert len(read_results(broken / "results.jsonl")[0]) == 2
    evaluate(config(broken), resume=True, runner=fake.make_runner())

    def timeless(folder):
        lines = map(json.loads, (folder / "results.jsonl").read_text().splitlines())
        return [{k: v for k, v in line.items() if k != "wall_s"} for line in lines]

    assert timeless(broken) == timeless(whole)


def test_a_worker_that_finds_no_server_has_lost_it(tmp_path):
    gone = replace(config(tmp_path, EstimatorSettings("ws://localhost:9")), objects=few(TASK))
    runner = BaselineRunner(gone.planner, gone.estimator)
    with pytest.raises(ServerLostError, match="no estimator server answers .*repeat with --resume"):
        run_one(gone, runner, TASK, 0)


def test_a_lost_server_is_exit_1_and_one_line(tmp_path, monkeypatch, capsys):
    def lost(*_, **__):
        raise ServerLostError("ws://there: connection lost")

    monkeypatch.setattr("manipose_mj.evaluation.episode.run_episode", lost)
    monkeypatch.setattr("manipose_mj.cli.builtin_objects.load_objects", lambda names, jobs: [])
    words = ["--objects", "mug_000", "--pose", "estimated", "--estimator", MIDDLE.name]
    out = ["--jobs", "1", "--episodes", "2", "--out", str(tmp_path / "out")]
    assert main(["evaluate", TASK, *words, *out]) == 1
    said = capsys.readouterr().err
    assert said.startswith("manipose: ws://there: connection lost; finished episodes are kept")
    assert said.count("\n") == 1 and "--resume" in said


def test_episodes_are_asked_of_it(tmp_path, monkeypatch):
    asked = []

    def run_episode(config, spec, *, episode, pose, estimator, planner, errors, grasps):
        asked.append((pose, estimator))
        return fake.make_runner()(config, spec, episode=episode, pose=pose)

    monkeypatch.setattr("manipose_mj.evaluation.episode.run_episode", run_episode)
    evaluate(config(tmp_path))
    assert asked == [("estimated", MIDDLE)] * 4


def test_the_traceback_of_an_estimator_on_a_server_is_found():
    with answering(Raises().estimate) as address:
        service = load_estimator(EstimatorSettings(address))
        with pytest.raises(EstimatorFailedError) as caught:
            service.estimate({})
    failure = StageFailure("perception", "no estimate")
    failure.__cause__ = caught.value
    assert "answers.py" in traceback_of(failure)
    with answering(lambda question: {"score": 1.0}) as address:
        service = load_estimator(EstimatorSettings(address))
        with pytest.raises(EstimatorFailedError) as caught:
            service.estimate({})
    failure.__cause__ = caught.value
    assert traceback_of(failure) == ""  # a wrong answer raised nothing


@pytest.mark.full
@pytest.mark.parametrize("remote", [False, True])
def test_an_estimator_that_raises_leaves_its_traceback(remote, tmp_path):
    with answering(Raises().estimate) as address:
        raises = EstimatorSettings(address if remote else "tests.estimators.answers:Raises")
        asked = replace(config(tmp_path, raises), objects=few(TASK), episodes=1)
        (result,) = evaluate(asked)
    assert result.failure == "perception" and "KeyError" in result.reason
    (note,) = tmp_path.rglob("*.error.txt")
    assert "answers.py" in note.read_text() and "KeyError" in note.read_text().splitlines()[-1]
    assert note.with_name(note.name.replace(".error.txt", ".npz")).is_file()
