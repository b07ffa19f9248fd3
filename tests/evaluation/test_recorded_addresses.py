"""Passwords and tokens in the addresses of servers open the servers and are on no record."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import tests.evaluation.fake_episodes as fake
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.evaluation import runner
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.report.html import write_report
from manipose_mj.evaluation.runner import evaluate

TASK = "single_object/target_pose"
OPEN, SHOWN = "ws://me:s3cret@there:8000/a?token=abc", "ws://there:8000/a"


def config(out: Path, kind: str, name: str = OPEN) -> EvaluationConfig:
    if kind == "policy":
        method = {"policy": PolicySettings(name)}
    else:
        method = {"estimator": EstimatorSettings(name), "pose": "estimated"}
    return EvaluationConfig((TASK,), out, episodes=2, **method)


class Silent:
    """A server that says nothing of itself."""

    def __init__(self) -> None:
        self.estimator = self

    def close(self) -> None: ...


@pytest.mark.parametrize("kind", ["policy", "estimator"])
def test_nothing_that_is_left_holds_them_and_resume_knows_the_run(kind, tmp_path, monkeypatch):
    asked = []

    def load(settings, arguments=None):
        asked.append(getattr(settings, "name", settings))
        return Silent()

    monkeypatch.setattr(runner, f"load_{kind}", load)
    first = evaluate(config(tmp_path, kind), runner=fake.make_runner())
    write_report(tmp_path, scene=fake.scene)
    for name in ("run.json", "summary.json", "report.html", "results.jsonl"):
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert "s3cret" not in text and "abc" not in text
        assert name == "results.jsonl" or SHOWN in text
    run = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert run[kind]["name"] == SHOWN and f"--{kind} {SHOWN} " in run["command"]
    other = OPEN.replace("abc", "def")
    assert evaluate(config(tmp_path, kind, other), resume=True, runner=fake.make_runner()) == first
    assert asked == [OPEN, other]
