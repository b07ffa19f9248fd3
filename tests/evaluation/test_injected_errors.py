"""Errors made on purpose: results and cards say so, and what nobody would notice is refused."""

from __future__ import annotations

import json

import pytest

import tests.evaluation.fake_episodes as fake
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.evaluation.cards.markdown import method_text
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.injected_errors import InjectedErrors
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.runner import evaluate

TASK = "single_object/target_pose"
SOME = InjectedErrors(pose_error_cm=2, camera_error_deg=1, cameras=("front",), assume_upright=True)
POLICY = PolicySettings("tests.policies.some:Policy", obs_mode="state")


def config(out, errors: InjectedErrors, **changes) -> EvaluationConfig:
    return EvaluationConfig((TASK,), out, 2, errors=errors, **{"pose": "estimated", **changes})


def test_without_errors_nothing_is_said_or_changed(tmp_path):
    plain = EvaluationConfig((TASK,), tmp_path, 2)
    assert plain.identity["injected errors"] is None and not plain.errors.words
    env = plain.env_config(TASK)
    assert env.latency == 0 and not env.sensors.pose_error and not env.sensors.camera_error
    assert not InjectedErrors().pose_errors()


def test_results_say_which_errors_were_made(tmp_path):
    evaluate(config(tmp_path, SOME), runner=fake.make_runner())
    run, summary = (json.loads((tmp_path / f"{n}.json").read_text()) for n in ("run", "summary"))
    told = {
        "pose_error_cm": 2,
        "camera_error_deg": 1,
        "cameras": ["front"],
        "assume_upright": True,
    }
    assert run["injected errors"] == summary["injected errors"] == told
    assert summary["poses"]["objects"] == "estimated, off by 2 cm, taken to stand upright"
    words = "--pose-error-cm 2 --camera-error-deg 1 --cameras front --assume-upright"
    assert words in run["command"]
    with pytest.raises(InputError, match="its results have injected errors"):
        evaluate(config(tmp_path, InjectedErrors()), resume=True, runner=fake.make_runner())


def test_the_command_line_makes_the_errors_it_names(tmp_path, monkeypatch):
    made = []

    def run_episode(config, spec, *, episode, pose, errors, **_):
        made.append((config, errors))
        return fake.make_runner()(config, spec, episode=episode, pose=pose)

    monkeypatch.setattr("manipose_mj.evaluation.episode.run_episode", run_episode)
    monkeypatch.setattr("manipose_mj.cli.builtin_objects.load_objects", lambda names, jobs: [])
    monkeypatch.setattr(
        "manipose_mj.evaluation.report.html.write_report", lambda out, jobs: "report.html"
    )
    words = ["--pose", "estimated", "--pose-error-deg", "90", "--latency-ms", "40"]
    words += ["--depth-noise", "0", "--cameras", "front", "overview"]
    out = ["--episodes", "1", "--jobs", "1", "--out", str(tmp_path / "out")]
    assert main(["evaluate", TASK, "--objects", "mug_000", *words, *out]) == 0
    env, errors = made[0]
    assert errors.error.rotation == pytest.approx(1.5707963) and errors.error.translation == 0
    assert env.latency == pytest.approx(0.04)
    assert env.sensors.cameras == ("front", "overview") and env.sensors.depth_sensor is None


@pytest.mark.parametrize(
    ("errors", "changes", "said"),
    [
        ({"camera_error_deg": 1.0}, {"pose": "oracle"}, "--camera-error-deg: with true poses"),
        ({"depth_noise": 2.0}, {"pose": "oracle"}, "--depth-noise: with true poses"),
        ({"pose_error_cm": 1.0}, {"pose": "oracle", "policy": POLICY}, "sees no poses"),
        (
            {"cameras": ("front", "right")},
            {"pose": "oracle", "policy": PolicySettings("a:b", obs_format="droid")},
            "--cameras: DROID's format needs panda/wrist too",
        ),
        ({"cameras": ("front",)}, {"pose": "oracle", "policy": POLICY}, "sees no images"),
        ({"assume_upright": True}, {"pose": "oracle", "policy": POLICY}, "of the baseline"),
    ],
)
def test_what_nobody_would_notice_is_refused(tmp_path, errors, changes, said):
    with pytest.raises(InputError, match=said):
        config(tmp_path / "out", InjectedErrors(**errors), **changes)
    assert not (tmp_path / "out").exists()


OPEN = [f"articulated/open_{level}_drawer" for level in ("top", "middle", "bottom")]
NOTICED_BY_NOBODY = "articulated/open_middle_drawer has no objects; leave "


@pytest.mark.parametrize(
    ("tasks", "errors", "changes", "said"),
    [
        (OPEN[1:2], {"pose_error_cm": 1.0}, {}, f"--pose-error-cm: {NOTICED_BY_NOBODY}it out"),
        (OPEN[1:2], {"pose_error_deg": 1.0}, {}, f"--pose-error-deg: {NOTICED_BY_NOBODY}it out"),
        (OPEN[1:2], {"assume_upright": True}, {}, f"--assume-upright: {NOTICED_BY_NOBODY}it out"),
        (
            OPEN[1:2],
            {"pose_error_cm": 1.0},
            {"policy": PolicySettings("a:b", obs_mode="pose")},
            f"--pose-error-cm: {NOTICED_BY_NOBODY}it out",
        ),
        (
            [TASK, OPEN[1]],
            {"pose_error_cm": 1.0},
            {},
            f"--pose-error-cm: {NOTICED_BY_NOBODY}that task out",
        ),
        (
            [*OPEN, "articulated/close_oven", TASK],
            {"pose_error_cm": 1.0},
            {},
            f"--pose-error-cm: {', '.join(OPEN)} and 1 more have no objects; leave those tasks out",
        ),
    ],
)
def test_errors_of_objects_need_objects(tmp_path, tasks, errors, changes, said):
    with pytest.raises(InputError) as refusal:
        EvaluationConfig(tuple(tasks), tmp_path, errors=InjectedErrors(**errors), **changes)
    assert str(refusal.value) == said


@pytest.mark.parametrize("task", ["articulated/store_oven", "articulated/take_out_oven", TASK])
def test_tasks_with_objects_take_errors_of_them(task, tmp_path):
    EvaluationConfig((task,), tmp_path, errors=InjectedErrors(pose_error_cm=1.0))


def test_late_targets_are_noticed_without_objects(tmp_path):
    EvaluationConfig((OPEN[1],), tmp_path, errors=InjectedErrors(latency_ms=40.0))


@pytest.mark.parametrize("value", [-1.0, float("inf"), float("nan")])
def test_sizes_are_finite_and_not_negative(value):
    with pytest.raises(InputError, match="--pose-error-cm is"):
        InjectedErrors(pose_error_cm=value).check()


def test_words_say_every_digit():
    assert InjectedErrors(pose_error_cm=1.23456789).words == ["--pose-error-cm", "1.23456789"]
    assert InjectedErrors(pose_error_cm=2.0).words == ["--pose-error-cm", "2"]


def test_a_negative_size_is_one_line_of_the_command(tmp_path, capsys):
    out = tmp_path / "out"
    words = ["evaluate", "single_object/target_pose", "--latency-ms", "-5", "--out", str(out)]
    assert main(words) == 2 and not out.exists()
    assert capsys.readouterr().err == "manipose: --latency-ms is -5.0; expected 0 or more\n"


def test_a_card_says_which_errors_were_made():
    method = {"policy": None, "pose": "oracle", "injected errors": {"pose_error_cm": 2.0}}
    assert method_text(method).endswith("; errors made on purpose: pose error cm 2.0")


def test_results_say_where_grasps_come_from(tmp_path):
    made = config(tmp_path, InjectedErrors(), grasps="cloud")
    evaluate(made, runner=fake.make_runner())
    run, summary = (json.loads((tmp_path / f"{n}.json").read_text()) for n in ("run", "summary"))
    assert run["grasps"] == summary["grasps"] == "cloud" and "--grasps cloud" in run["command"]
    plain = config(tmp_path, InjectedErrors(), pose="oracle")
    assert plain.identity["grasps"] is None and plain.grasp_source == "annotated"
    assert ", grasps by cloud" in method_text({"pose": "estimated", "grasps": "cloud"})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"grasps": "clouds"}, "did you mean cloud"),
        ({"grasps": "cloud", "pose": "oracle"}, "needs --pose estimated"),
        ({"grasps": "annotated", "pose": "oracle", "policy": POLICY}, "of the baseline"),
    ],
)
def test_grasps_of_another_source_are_refused(tmp_path, changes, said):
    with pytest.raises(InputError, match=said):
        config(tmp_path, InjectedErrors(), **changes)
