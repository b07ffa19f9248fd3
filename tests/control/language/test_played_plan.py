"""An episode that a language model plans, and the same once more from what it said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manipose_mj.cli.main import main
from manipose_mj.control import baseline
from manipose_mj.control.language.endpoint import KEY_VARIABLE
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.errors import InputError
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.planner_settings import PlannerSettings
from manipose_mj.evaluation.records import (
    EpisodeResult,
    read_results,
    read_trajectory,
    trajectory_path,
)
from manipose_mj.evaluation.runner import evaluate
from tests.control.language.local_server import Server, says

TASK = "single_object/target_pose"
KEY = "sk-secret-of-this-test"
PLAN = json.dumps(
    {
        "plan": [
            {"primitive": "grasp_at", "subject": "object"},
            {"primitive": "move_to", "subject": "object", "destination": "goal of object"},
            {"primitive": "release", "subject": "object"},
        ],
        "refusal": "",
    }
)


def played(out: Path) -> EpisodeResult:
    """The one episode of an evaluation, without the times that it took."""
    (result,), _ = read_results(out / "results.jsonl")
    return replace(result, wall_s=0.0, policy_s=0.0)


@pytest.mark.full
def test_an_episode_by_a_model_is_the_same_when_its_answers_are_replayed(tmp_path, monkeypatch):
    monkeypatch.setenv(KEY_VARIABLE, KEY)
    server = Server([says("I would pick it up."), says(PLAN)])
    episode = [TASK, "--episodes", "1", "--objects", "cup_004", "--jobs", "1"]
    asked, replayed = tmp_path / "asked", tmp_path / "replayed"
    model = ["--planner", "llm", "--model", "m", "--base-url", server.url]
    try:
        assert main(["evaluate", *episode, *model, "--out", str(asked)]) == 0
    finally:
        server.close()
    assert len(server.requests) == 2, "a plan, and one mistake that was put right"
    from_file = ["--planner", "replay", "--replay", str(asked / "exchanges")]
    assert main(["evaluate", *episode, *from_file, "--out", str(replayed)]) == 0
    first, second = played(asked), played(replayed)
    assert first.success_at_end, first.reason
    assert first == second
    paths = [read_trajectory(trajectory_path(out, TASK, 0)) for out in (asked, replayed)]
    np.testing.assert_array_equal(paths[0].qpos, paths[1].qpos)
    written = [path.read_bytes() for path in asked.rglob("*") if path.is_file()]
    assert written and not any(KEY.encode() in content for content in written)


EPISODE = [TASK, "--episodes", "1", "--objects", "cup_004", "--jobs", "1"]


def by_model(server: Server, out: Path, *more: str) -> int:
    """Ends the server too."""
    model = ["--planner", "llm", "--model", "m", "--base-url", server.url, "--out", str(out)]
    try:
        return main(["evaluate", *EPISODE, *model, *more])
    finally:
        server.close()


@pytest.mark.full
def test_an_own_instruction_is_carried_out_once_and_replayed_without_being_given(
    tmp_path, monkeypatch
):
    monkeypatch.setenv(KEY_VARIABLE, KEY)
    server = Server([says(PLAN.replace("goal of object", "table"))])
    asked, replayed = tmp_path / "asked", tmp_path / "replayed"
    assert by_model(server, asked, "--instruction", "Put the cup elsewhere.") == 0
    assert len(server.requests) == 1
    from_file = ["--planner", "replay", "--replay", str(asked / "exchanges")]
    assert main(["evaluate", *EPISODE, *from_file, "--out", str(replayed)]) == 0
    assert played(asked) == played(replayed)
    assert (played(asked).failure, played(asked).decisions > 10) == ("release", True)


@pytest.mark.full
def test_an_own_instruction_looks_behind_nothing_for_the_goals(tmp_path, monkeypatch):
    """As with furniture that is estimated, where goals may be about what a part hides."""
    monkeypatch.setenv(KEY_VARIABLE, KEY)
    monkeypatch.setattr(OraclePerception, "feels_joints", True)
    monkeypatch.setattr(baseline, "parts_to_look_behind", lambda goals, estimate: ("door",))
    server = Server([says('{"plan": [], "refusal": ""}')] * 8)
    assert by_model(server, tmp_path, "--instruction", "Leave all as it is.") == 0
    assert len(server.requests) == 1 and played(tmp_path).failure == "release"


@pytest.mark.full
def test_exchanges_that_cannot_be_written_end_the_evaluation(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(KEY_VARIABLE, KEY)
    (tmp_path / "exchanges").touch()
    assert by_model(Server([says(PLAN)]), tmp_path) == 2
    assert "exchanges cannot be written there" in " ".join(capsys.readouterr().err.split())
    assert read_results(tmp_path / "results.jsonl")[0] == []


def test_what_a_planner_lacks_is_told_before_anything_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv(KEY_VARIABLE, raising=False)
    model = ["--planner", "llm", "--model", "m", "--out", str(tmp_path / "out")]
    assert main(["evaluate", TASK, *model]) == 2
    assert "no key for the language model" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    with pytest.raises(InputError, match="no key"):
        settings = PlannerSettings("llm", "m")
        evaluate(EvaluationConfig((TASK,), tmp_path / "out", planner=settings))
    assert not (tmp_path / "out").exists()
