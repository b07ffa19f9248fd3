"""Episodes of policies: rates, clipping, rules, failures, in process and over a websocket."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from manipose_mj.cli.evaluate import common_reasons
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.evaluation.cards.method import method_of, method_text, sources_of
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.episode import (
    environment_of,
    run_episode,
    run_policy_episode,
)
from manipose_mj.evaluation.policy_settings import Attachment, PolicySettings, attachment_of
from manipose_mj.evaluation.protocol import load as load_protocol
from manipose_mj.evaluation.results_folder import RUN_FILE, SUMMARY_FILE
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.policies.baseline import BaselinePolicy
from manipose_mj.policies.loading import load_policy
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from tests.few_objects import config, few
from tests.policies.own_policies import Breaking, Peeking, Reaching, Reporting, answering_narrow
from tests.policies.test_remote import served

TASK = "single_object/target_pose"
HERE = "tests.policies.own_policies"
REACHING = PolicySettings(f"{HERE}:Reaching")


def env_config(**options: Any) -> EnvConfig:
    return config(TASK, **{"obs_mode": "state", **options})


def evaluation(out: Path, settings: PolicySettings, **options: Any) -> EvaluationConfig:
    options = {"episodes": 4, "objects": few(TASK), **options}
    return EvaluationConfig((TASK,), out, policy=settings, **options)


def timeless(out: Path) -> list[dict[str, Any]]:
    lines = (out / "results.jsonl").read_text().splitlines()
    return [
        {k: v for k, v in json.loads(line).items() if k not in ("wall_s", "policy_s")}
        for line in lines
    ]


def run(settings: PolicySettings, seed: int = 1, **options: Any):
    return run_policy_episode(env_config(**options), EpisodeSpec(seed), settings=settings)[0]


def test_the_time_of_a_policy_that_gives_up_counts():
    result = run(PolicySettings(f"{HERE}:LongGivingUp"))
    assert (result.failure, result.decisions) == ("plan", 0)
    assert 0.2 < result.policy_s < result.wall_s


@pytest.mark.parametrize(
    ("hz", "execute", "decisions", "steps"),
    [
        (10.0, None, 5, 5 * 4 * 5),
        (50.0, None, 5, 5 * 4),
        (10.0, 1, 5, (4 * 1 + 4) * 5),
        (15.0, 3, 5, round((4 * 3 + 4) * 50 / 15)),
    ],
)
def test_actions_are_held_at_the_rate_and_all_answers_but_the_last_cut(
    hz, execute, decisions, steps
):
    result = run(replace(REACHING, hz=hz, execute=execute))
    assert (result.decisions, result.steps) == (decisions, steps)
    assert result.clipped_actions == 0 and 0 < result.policy_s < result.wall_s
    assert (result.failure, result.pose_source) == ("release", "none")


def test_held_targets_stay_where_the_action_sent_them():
    """In a mode of differences an action moves once, not in every control step."""
    moving = PolicySettings(
        f"{HERE}:Once", control_mode="pd_joint_target_delta_pos", hz=10.0, stop="horizon"
    )
    _, trajectory = run_policy_episode(
        env_config(control_mode=moving.control_mode), EpisodeSpec(1), settings=moving
    )
    moved = np.abs(trajectory.qpos[-1, :7] - trajectory.qpos[0, :7])
    np.testing.assert_allclose(moved[0], 0.1, atol=0.01)


def test_what_is_beyond_a_limit_is_clipped_and_counted():
    result = run(replace(REACHING, arguments='{"beyond": 0.01}'))
    assert result.clipped_actions == 20
    assert run(replace(REACHING, arguments='{"beyond": 1e-7}')).clipped_actions == 0


@pytest.mark.parametrize(
    ("obs_mode", "pose", "masks"),
    [
        ("state+rgb+pointcloud/points", "none", "none"),
        ("state+pose", "oracle", "none"),
        ("state+pointcloud", "none", "oracle"),
        ("pose+segmentation", "oracle", "oracle"),
    ],
)
def test_observations_that_tell_the_truth_are_named(obs_mode, pose, masks):
    asked = evaluation(Path(), replace(REACHING, obs_mode=obs_mode))
    assert (asked.pose_source, asked.mask_source) == (pose, masks)
    assert asked.identity["pose"] == pose
    source = "true" if pose == "oracle" else "none"
    assert asked.poses == {"objects": source, "furniture": source}


@pytest.mark.parametrize(
    ("name", "obs_mode", "pose", "masks"),
    [
        ("Reaching", "state", "none", "none"),
        ("Reaching", "state+pose", "oracle", "none"),
        ("Peeking", "state", "oracle", "oracle"),  # its episodes fail, and say so nevertheless
    ],
)
def test_all_records_agree_on_what_a_policy_got(name, obs_mode, pose, masks, tmp_path):
    settings = PolicySettings(f"{HERE}:{name}", obs_mode=obs_mode)
    evaluate(evaluation(tmp_path, settings, episodes=1))
    (line,) = timeless(tmp_path)
    assert (line["pose_source"], line["mask_source"]) == (pose, masks)
    source = "true" if pose == "oracle" else "none"
    run, summary = (json.loads((tmp_path / file).read_text()) for file in (RUN_FILE, SUMMARY_FILE))
    assert (run["pose"], run["masks"]) == (summary["pose"], summary["masks"]) == (pose, masks)
    assert summary["poses"] == {"objects": source, "furniture": source}
    assert sources_of(run) == (pose, masks)
    assert ("it was given the simulator" in method_text(method_of(run))) == (name == "Peeking")


def test_a_policy_with_the_simulator_is_believed_only_names_that_there_are():
    told = attachment_of(BaselinePolicy("estimated"))
    assert told == Attachment("estimated", "oracle")
    assert attachment_of(BaselinePolicy()) == Attachment("oracle", "none")
    claiming = Peeking()
    claiming.pose_source, claiming.mask_source = "none", ["none"]
    assert attachment_of(claiming) == Attachment("oracle", "oracle")
    assert attachment_of(Reaching()) is None


@pytest.mark.parametrize(("stop", "steps"), [("success", 25), ("horizon", 100)])
def test_an_episode_ends_half_a_second_after_success_or_not(stop, steps, monkeypatch):
    monkeypatch.setattr("manipose_mj.tasks.core.task.success", lambda *goals: True)
    result = run(replace(REACHING, stop=stop))
    assert (result.steps, result.success_once, result.success_at_end) == (steps, True, True)


@pytest.mark.parametrize(
    ("name", "stage", "said"),
    [
        ("answering_nan", "policy", "no finite number"),
        ("answering_flat", "policy", r"shape \(8,\)"),
        ("GivingUp", "plan", "no way"),
    ],
)
def test_a_wrong_answer_is_a_failure_of_its_stage(name, stage, said):
    result = run(PolicySettings(f"{HERE}:{name}"))
    assert result.failure == stage and result.steps == 0
    assert re.search(said, result.reason)


def test_a_policy_that_raises_fails_its_episodes_and_leaves_a_traceback(tmp_path):
    results = evaluate(evaluation(tmp_path, PolicySettings(f"{HERE}:Raising"), episodes=1))
    assert results[0].failure == "policy" and "KeyError: 'weights'" in results[0].reason
    (note,) = tmp_path.rglob("*.error.txt")
    assert "own_policies.py" in note.read_text()
    (line,) = common_reasons(results, tmp_path)
    assert line == f"failed in the policy, 1 of 1: {results[0].reason}; see {note}"
    others = [replace(results[0], episode=i, failure="plan", reason="no way") for i in (1, 2)]
    lines = common_reasons([*others, *results], tmp_path)
    assert lines == [line.replace("1 of 1", "1 of 3"), "failed in plan, 2 of 3: no way"]


def test_a_policy_is_made_once_and_asked_for_actions_alone(tmp_path):
    load_policy.cache_clear()
    Reporting.made = 0
    settings = PolicySettings(f"{HERE}:Reporting")
    (result,) = evaluate(evaluation(tmp_path, settings, episodes=1, jobs=2))
    assert result.failure != "error"
    assert Reporting.made == 1


def test_a_policy_that_breaks_with_the_goal_met_has_failed(tmp_path, monkeypatch):
    monkeypatch.setattr("manipose_mj.tasks.core.task.success", lambda *goals: True)
    lines = []
    for how in ("nan", "shape", "raise", "served"):
        out, settings = tmp_path / how, PolicySettings(f"{HERE}:Breaking", json.dumps({"how": how}))
        with served(Breaking()) as server:
            if how == "served":
                settings = PolicySettings(server.address)
            evaluate(evaluation(out, settings, episodes=1))
        lines += timeless(out)
        notes = [note.read_text() for note in out.rglob("*.error.txt")]
        raised = how in ("raise", "served")
        assert len(notes) == raised and all("own_policies.py" in note for note in notes)
        assert ("KeyError: 'weights'" in lines[-1].pop("reason")) == raised
    decisions = [line.pop("decisions") for line in lines]
    assert decisions == [2, 2, 1, 1]  # an answer that is none is one all the same
    assert all(line == lines[0] for line in lines)
    told = lines[0]
    assert (told["failure"], told["success_at_end"], told["success_once"]) == (
        "policy",
        False,
        True,
    )
    assert told["steps"] == 5 and told["object"]


def test_a_policy_that_cannot_be_attached_fails_its_episodes():
    result = run(PolicySettings(f"{HERE}:Unattached"))
    assert (result.failure, result.decisions, result.steps) == ("policy", 0, 0)
    assert result.reason == "the policy's attach raised KeyError: 'panda'" and result.object


@pytest.mark.full
def test_the_baseline_is_a_policy_behind_the_same_door():
    settings = PolicySettings(
        "manipose_mj.policies.baseline:BaselinePolicy", hz=50.0, stop="horizon"
    )
    one, path = run_episode(env_config(), EpisodeSpec(1))
    assert (one.pose_source, one.mask_source) == ("oracle", "none")
    two, again = run_policy_episode(env_config(), EpisodeSpec(1), settings=settings)
    assert replace(one, wall_s=0, policy_s=0) == replace(two, wall_s=0, policy_s=0)
    assert one.success_at_end and one.decisions == one.steps + 1
    np.testing.assert_array_equal(path.qpos, again.qpos)
    assert path.annotations == again.annotations
    with pytest.raises(InputError, match="the baseline acts in pd_joint_pos at 50 Hz"):
        run(replace(settings, hz=10.0))


def test_in_process_and_over_a_websocket_results_are_equal(tmp_path):
    evaluate(evaluation(tmp_path / "here", REACHING))
    load_policy.cache_clear()
    with served(load_policy(REACHING.name)) as server:
        evaluate(evaluation(tmp_path / "there", replace(REACHING, name=server.address)))
    assert timeless(tmp_path / "here") == timeless(tmp_path / "there")
    assert json.loads((tmp_path / "here" / RUN_FILE).read_text())["policy metadata"] == {
        "name": "reaching"
    }


@pytest.mark.full
def test_results_do_not_depend_on_the_number_of_jobs(tmp_path):
    evaluate(evaluation(tmp_path / "one", REACHING))
    evaluate(evaluation(tmp_path / "two", REACHING, jobs=2))
    with served(Reaching) as server:
        evaluate(evaluation(tmp_path / "away", replace(REACHING, name=server.address), jobs=2))
    assert timeless(tmp_path / "one") == timeless(tmp_path / "two") == timeless(tmp_path / "away")


def test_the_command_repeats_the_evaluation(tmp_path):
    settings = PolicySettings("a.b:C", '{"path": "x y"}', "state+pose", hz=12.5, execute=3)
    config = EvaluationConfig((TASK,), tmp_path, 5, protocol="v1", resample=4, policy=settings)
    assert (
        '--protocol v1 --resample 4 --policy a.b:C --policy-args \'{"path": "x y"}\' --obs-mode '
        "state+pose --control-mode pd_joint_pos --hz 12.5 --execute 3 --obs-format manipose "
        "--stop success"
    ) in config.command


@pytest.mark.parametrize("hz", [50.0, 12.5, 20 / 3, 0.1 + 0.2])
def test_the_command_states_the_rate_exactly(hz):
    words = PolicySettings("a.b:C", hz=hz).words
    assert float(words[words.index("--hz") + 1]) == hz


def test_resampling_keeps_what_an_episode_is_about(tmp_path):
    asked = EvaluationConfig((TASK,), tmp_path, 20, protocol="v1")
    other = replace(asked, resample=1)
    frozen = load_protocol("v1")
    for episode in range(20):
        one, two = asked.episode_spec(TASK, episode), other.episode_spec(TASK, episode)
        assert one.object == two.object == frozen.episode(TASK, episode).object
        assert one.seed != two.seed == other.episode_seed(TASK, episode)
    again = replace(asked, resample=2)
    assert again.episode_seed(TASK, 0) != other.episode_seed(TASK, 0)
    assert other.identity["resample"] == 1 and asked.identity["resample"] is None


POLICY = f"evaluate {TASK} --jobs 1 --out {{tmp}}/out --policy {HERE}:Reaching"


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (f"evaluate {TASK} --policy no.module:A --out {{tmp}}/out", "cannot import no.module"),
        (f"evaluate {TASK} --policy {HERE}:WithoutInfer --out {{tmp}}/out", "no method infer"),
        (f"evaluate {TASK} --policy ws://localhost:9 --out {{tmp}}/out", "no policy server"),
        (f"{POLICY} --obs-mode state+poses", "did you mean pose"),
        (f"{POLICY} --obs-mode state+pose/handle", "unknown observation key 'pose/handle'"),
        (f"{POLICY} --control-mode pd_joint", "did you mean pd_joint"),
        (f"{POLICY} --control-mode primitive", "has no rate"),
        (f"{POLICY} --hz 0", "hz is 0; expected more than 0 and at most 50"),
        (f"{POLICY} --hz 60", "hz is 60; expected more than 0 and at most 50"),
        (f"{POLICY} --execute 0", "execute is 0; expected at least 1"),
        (f"{POLICY} --pose estimated", "leave it out with a policy"),
        (f"{POLICY} --obs-format droid --obs-mode state", "lacks what DROID's format is made of"),
        (
            f"{POLICY} --obs-format droid --obs-mode state+rgb+pose+depth",
            "'state+rgb+pose+depth' has more than what DROID's format is made of; add --obs-mode st",
        ),
        (f"{POLICY} --policy-args [1]", "expected a JSON object"),
        (f'{POLICY} --policy-args {{{{"a":NaN}}}}', "NaN is no finite number"),
        (f"{POLICY} --resample 3", "there is no protocol whose seeds it replaces"),
        (f"evaluate {TASK} --hz 5", "hz: for a policy only"),
        (f"evaluate --objects mug_000 {TASK}", "write tasks before options"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(argv, said, tmp_path, capsys):
    words = argv.format(tmp=tmp_path).split()
    if "handle" in argv:
        words += ["--objects", *few(TASK)]
    assert main(words) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and said in lines[0]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("jobs", "remote"),
    [(1, False), (1, True), pytest.param(2, False, marks=pytest.mark.full)],
)
def test_actions_of_another_control_mode_end_the_evaluation(jobs, remote, tmp_path, capsys):
    words = ["evaluate", TASK, "--jobs", str(jobs), "--episodes", "2", "--objects", *few(TASK)]
    with served(answering_narrow()) as server:
        name = server.address if remote else f"{HERE}:answering_narrow"
        assert main([*words, "--out", str(tmp_path / "out"), "--policy", name]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert "have 7 numbers; pd_joint_pos takes 8" in said


def test_a_step_that_nobody_observes_changes_only_the_observation():
    one = environment_of(env_config(obs_mode="state+pose"))
    first = one.reset(EpisodeSpec(4)).observation
    target = np.append(first["panda/joint_positions"] + 0.05, 0.04)
    looked = [one.step(target).observation for _ in range(6)]
    one.reset(EpisodeSpec(4))
    steps = [one.step(target, observe=i % 3 == 2).observation for i in range(6)]
    for name, value in looked[5].items():
        np.testing.assert_array_equal(steps[5][name], value)
        np.testing.assert_array_equal(steps[2][name], looked[2][name])
        np.testing.assert_array_equal(steps[4][name], looked[2][name])
