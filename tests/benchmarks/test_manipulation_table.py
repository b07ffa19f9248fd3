"""Tables of evaluations tell methods apart, and strips are of the episodes that they say."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

import pytest
from PIL import Image

import tests.evaluation.fake_episodes as fake
from manipose_mj.errors import InputError
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.evaluation.cards.run_record import RunRecord, read_run
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.injected_errors import InjectedErrors
from manipose_mj.evaluation.planner_settings import PlannerSettings
from manipose_mj.evaluation.policy_settings import Attachment, PolicySettings
from manipose_mj.evaluation.records import read_results, trajectory_path
from tests.evaluation.cards.test_cards import evaluated

TASK = fake.TASKS[0]
TRUE_POLICY = PolicySettings("own:Policy", obs_mode="state+pose")
ATTACHED = PolicySettings("own:Policy", attachment=Attachment(pose_source="estimated"))
MODEL = PlannerSettings("llm", model="org/small", base_url="http://localhost:1/v1")
OWN = EstimatorSettings("own:Estimator", '{"size": 3}', give_cad=True)
BENT = InjectedErrors(pose_error_cm=8.0)


@pytest.fixture
def script():
    return importlib.import_module("manipulation_table")


@pytest.fixture
def strips(monkeypatch):
    module = importlib.import_module("pictures.failure_strips")
    monkeypatch.setattr(module, "scene_model", fake.scene)
    return module


@pytest.fixture
def labels():
    return importlib.import_module("pictures.run_labels")


def run_of(**changes) -> dict:
    """What a run of these settings leaves in its `run.json`."""
    config = EvaluationConfig((TASK,), Path("out"), episodes=1, protocol="v1", **changes)
    return json.loads(json.dumps({**config.identity, "command": config.command}))


@pytest.mark.parametrize(
    ("changes", "label"),
    [
        ({}, "true"),
        ({"resample": 1}, "true, other seeds"),
        ({"resample": 2}, "true, other seeds 2"),
        ({"pose": "estimated"}, "estimated"),
        ({"pose": "estimated_objects"}, "estimated objects"),
        ({"pose": "estimated", "estimator": OWN}, "estimated by own:Estimator, given CAD"),
        ({"errors": BENT}, "true, pose error cm 8"),
        (
            {"pose": "estimated", "errors": InjectedErrors(cameras=("front", "left"))},
            "estimated, cameras front left",
        ),
        ({"errors": InjectedErrors(assume_upright=True)}, "true, assume upright"),
        ({"pose": "estimated", "grasps": "shape"}, "estimated, shape grasps"),
        ({"planner": MODEL}, "true, llm org/small"),
        ({"policy": TRUE_POLICY}, "policy own:Policy, true"),
        ({"policy": PolicySettings("own:Policy")}, "policy own:Policy, no poses"),
        ({"policy": ATTACHED}, "policy own:Policy, estimated"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_every_method_has_its_own_column(labels, changes, label):
    assert labels.label_of(run_of(**changes)) == label


def test_methods_of_one_label_are_not_added_up(labels):
    told = PlannerSettings("llm", model="org/small", base_url="http://localhost:1/v1", instruction="open it")  # fmt: skip
    runs = [RunRecord(run_of(planner=planner), (), "") for planner in (MODEL, told)]
    labels.check_labels(runs[:1] * 2)
    with pytest.raises(InputError, match="two runs of 'true, llm org/small' differ in planner"):
        labels.check_labels(runs)


def test_a_single_run_is_told_by_family_and_task(script, tmp_path, capsys):
    script.main(script.Arguments((evaluated(tmp_path / "one"),)))
    told = capsys.readouterr().out
    assert "## By family" in told and "| single object | " in told
    assert "## By task" in told and f"| `{TASK}` | " in told
    assert "## By planner" not in told


def test_a_column_holds_its_own_runs_only(script, tmp_path):
    folders = [
        evaluated(tmp_path / str(i), tasks=(TASK,), episodes=n) for i, n in enumerate((3, 4))
    ]
    own, bent = (read_run(folder) for folder in folders)
    bent = RunRecord({**bent.run, "injected errors": BENT.identity}, bent.results, "")
    episodes = [each for record in (own, bent) for each in script.episodes_of(record)]
    head, _, row = script.table(episodes, "task").splitlines()
    assert head == "| task | true | failures | true, pose error cm 8 | failures |"
    cells = row.split(" | ")
    assert "/3 (" in cells[1] and "/4 (" in cells[3]


def test_a_task_of_no_family_is_of_its_domain(script):
    results, _ = read_results(script.baseline_folders()[0] / "results.jsonl")
    object.__setattr__(results[0], "task", "pouring/cup")
    (played,) = script.episodes_of(RunRecord(run_of(), (results[0],), ""))
    assert played.family == "pouring"
    assert "| pouring | " in script.table([played], "family")


def failing(out: Path, **changes) -> tuple[Path, RunRecord]:
    """A run of fake episodes, some of which failed, with what its `run.json` would say after these changes."""
    record = read_run(evaluated(out, tasks=(TASK,), episodes=12))
    assert {result.failure is None for result in record.results} == {True, False}
    return out, RunRecord({**record.run, **run_of(**changes), "episodes": 12}, record.results, "")


def test_a_strip_is_drawn_from_the_trajectory_that_is_there(strips, tmp_path, monkeypatch):
    monkeypatch.setattr(strips, "run_one", None)
    run = failing(tmp_path / "run", policy=TRUE_POLICY)
    strips.draw_strips([run], tmp_path / "strips")
    failed = {r.episode for r in run[1].results if r.failure}
    drawn = list((tmp_path / "strips").iterdir())
    assert {path.name for path in drawn} == {
        f"single_object__target_pose-{episode}-policy-own-Policy-true.webp" for episode in failed
    }
    with Image.open(drawn[0]) as picture:
        assert picture.width > strips.PICTURES * strips.WIDTH - 1


def test_an_episode_is_played_once_more_by_its_own_method(strips, tmp_path, monkeypatch):
    changes = {"planner": MODEL, "pose": "estimated", "estimator": OWN, "errors": BENT}
    run = failing(tmp_path / "run", **changes)
    first = next(result for result in run[1].results if result.failure)
    (kept := trajectory_path(run[0], TASK, first.episode)).unlink()
    (run[0] / "exchanges").mkdir()
    played = []

    def once_more(config, runner, task, episode):
        played.append((config, runner, task, episode))
        copied = trajectory_path(config.out, task, episode)
        copied.parent.mkdir(parents=True)
        copied.write_bytes(trajectory_path(run[0], TASK, first.episode + 1).read_bytes())
        return first

    monkeypatch.setattr(strips, "run_one", once_more)
    strips.draw_strips([run], tmp_path / "strips")
    ((config, runner, *key),) = played
    assert key == [TASK, first.episode] and not kept.exists()
    assert runner.planner == PlannerSettings("replay", replay=run[0] / "exchanges")
    assert (runner.estimator, runner.errors, config.pose) == (OWN, BENT, "estimated")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"planner": MODEL}, "exchanges is not there"),
        ({"policy": TRUE_POLICY}, "its policy left no trajectory"),
        ({}, "played once more: success"),
    ],
)
def test_what_cannot_be_drawn_is_one_line(strips, tmp_path, monkeypatch, capsys, changes, said):
    run = failing(tmp_path / "run", **changes)
    first = next(result for result in run[1].results if result.failure)
    won = next(result for result in run[1].results if result.failure is None)
    trajectory_path(run[0], TASK, first.episode).unlink()
    monkeypatch.setattr(strips, "run_one", lambda *_: won)
    strips.draw_strips([run], tmp_path / "strips")
    lines = capsys.readouterr().err.splitlines()
    (line,) = [each for each in lines if each.startswith("no strip of")]
    assert line.startswith(f"no strip of {TASK}, episode {first.episode}: ") and said in line


def test_strips_of_others_stay(strips, tmp_path):
    run = failing(tmp_path / "run")
    won = next(result for result in run[1].results if result.failure is None)
    folder = tmp_path / "strips"
    folder.mkdir()
    others = [
        folder / strips.strip_name(won, "estimated"),
        folder / strips.strip_name(won, "true, other seeds"),
        folder / "clutter__pick-3-true.webp",
    ]
    for path in [*others, stale := folder / strips.strip_name(won, "true")]:
        path.touch()
    strips.draw_strips([run], folder)
    assert all(path.exists() for path in others) and not stale.exists()
