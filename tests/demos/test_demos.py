"""Demonstrations: recorded, resumed, replayed bit for bit, converted, exported; broken files are one line."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from manipose_mj.cli.main import main
from manipose_mj.demos import record as recording
from manipose_mj.demos.layout import (
    frozen_seeds,
    read_actions,
    read_set,
    refuse_frozen,
    refuse_test_objects,
)
from manipose_mj.demos.lerobot_export import ExportConfig, export
from manipose_mj.demos.playback import RecordedPolicy, slowed
from manipose_mj.demos.record import record
from manipose_mj.errors import InputError
from manipose_mj.evaluation.config import EvaluationConfig, episode_seed
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.policies.protocol import ActionSpace
from manipose_mj.robustness.plans import recorded_plans
from tests.demos.recordings import (
    OBJECTS,
    TASK,
    attempting,
    config,
    write_attempt,
)
from tests.places import ROOT


def test_recordings_have_maniskills_layout(demos):
    assert demos.path.name == "trajectory.none.pd_joint_pos.mujoco_cpu.h5"
    assert len(demos.episodes) == 2 and all(each.success for each in demos.episodes)
    document = json.loads(demos.path.with_suffix(".json").read_text())
    assert document["env_info"]["env_id"] == "manipose_mj/TargetPose-v0"
    assert {"versions", "protocol", "source_type"} <= document.keys()
    with h5py.File(demos.path) as file:
        for episode in document["episodes"]:
            group = file[f"traj_{episode['episode_id']}"]
            steps = episode["elapsed_steps"]
            assert group["actions"].shape == (steps, 8)
            assert group["env_states/qpos"].shape[0] == steps + 1
            for name in ("terminated", "truncated", "success"):
                assert group[name].shape == (steps,) and group[name].dtype == bool
            assert group["success"][-1] and not group["terminated"][:].any()
    assert demos.path.stat().st_size < 2 * 150e3
    assert not (demos.path.parent / recording.PARTS).exists()


@pytest.mark.sample(1)
@pytest.mark.parametrize(("hz", "execute"), [(50.0, None), (10.0, None), (10.0, 10)])
def test_recorded_targets_succeed_as_a_policy(demos, hz, execute, tmp_path):
    settings = PolicySettings(
        "manipose_mj.demos.playback:RecordedPolicy",
        json.dumps({"data": str(demos.path)}),
        hz=hz,
        execute=execute,
        stop="horizon",
    )
    first = next(config(tmp_path).seeds())[1]
    assert first == demos.episodes[0].episode_seed == episode_seed(1, TASK, 0)
    results = evaluate(EvaluationConfig((TASK,), tmp_path, 1, 1, objects=OBJECTS, policy=settings))
    assert results[0].success_at_end and results[0].clipped_actions == 0
    assert results[0].decisions == 1
    with pytest.raises(InputError, match="no recording of"):
        evaluate(EvaluationConfig((TASK,), tmp_path / "b", 1, 2, objects=OBJECTS, policy=settings))


def test_slow_targets_are_the_last_of_their_periods():
    actions = np.arange(12.0)[:, None]
    assert slowed(actions, 50.0)[:, 0].tolist() == list(range(12))
    assert slowed(actions, 10.0)[:, 0].tolist() == [4, 9, 11]


class _Writer:
    """Takes what LeRobot's writer takes, and refuses what it refuses."""

    def __init__(self, features):
        self.features, self.frames, self.episodes, self.finalized = features, [], 0, False

    def add_frame(self, frame):
        assert frame.keys() == {*self.features, "task"} and frame["task"].endswith(".")
        for name, feature in self.features.items():
            assert frame[name].shape == tuple(feature["shape"])
            assert frame[name].dtype == np.dtype(feature["dtype"])
        self.frames.append(frame)

    def save_episode(self):
        self.episodes += 1

    def finalize(self):
        self.finalized = True


@pytest.mark.full
def test_an_export_replays_at_its_rate_and_writes_frames(demos, tmp_path):
    opened = []

    def open_writer(asked, features):
        asked.out.mkdir()
        opened.append(_Writer(features))
        return opened[-1]

    def interrupted(done, total):
        raise KeyboardInterrupt

    config = ExportConfig(tmp_path / "sets" / "set")
    with pytest.raises(KeyboardInterrupt):
        export([demos], config, open_writer=open_writer, on_progress=interrupted)
    assert not opened.pop().finalized and not list(config.out.parent.iterdir())
    done = export([demos], config, open_writer=open_writer)
    (writer,) = opened
    assert [each.name for each in config.out.parent.iterdir()] == ["set"]
    assert writer.finalized and writer.episodes == done.episodes == 2 and done.lost == 0
    assert done.frames == len(writer.frames)
    assert done.frames == sum(-(-each.elapsed_steps // 5) for each in demos.episodes)
    actions = read_actions(demos, demos.episodes[0])
    np.testing.assert_allclose(writer.frames[0]["action"], actions[4], rtol=1e-6)
    assert list(writer.features) == [
        "observation.state", "action", "observation.environment_state",
    ]  # fmt: skip


def test_an_export_without_lerobot_names_the_extra(demos, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "lerobot", None)
    words = ["export", str(demos.path), "--format", "lerobot", "--out", str(tmp_path / "set")]
    assert main(["demos", *words]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and "needs LeRobot" in lines[0]
    assert 'pip install -e ".[lerobot]"' in lines[0]
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert extras["optional-dependencies"]["lerobot"][0].startswith("lerobot[dataset]>=0.6.1")
    assert not (tmp_path / "set").exists()


def test_changes_of_targets_are_played_at_their_rate_only(copied):
    description = copied.with_suffix(".json")
    description.write_text(description.read_text().replace("pd_joint_pos", "pd_ee_delta_pose"))
    policy, (episode, *_) = RecordedPolicy(str(copied)), read_set(copied).episodes
    space = ActionSpace(-np.ones(7), np.ones(7), "pd_ee_delta_pose", 10.0)
    told = {"task": TASK, "instruction": episode.instruction, "seed": episode.episode_seed}
    with pytest.raises(InputError, match="none can be left out: add --hz 50"):
        policy.reset(**told, action_space=space)
    policy.reset(**told, action_space=replace(space, hz=50.0))
    assert len(policy.infer({})["actions"]) == episode.elapsed_steps


def test_recordings_are_played_on_their_objects_only(copied):
    policy, (episode, *_) = RecordedPolicy(str(copied)), read_set(copied).episodes
    told = {"task": TASK, "seed": episode.episode_seed}
    space = ActionSpace(-np.ones(8), np.ones(8), "pd_joint_pos", 50.0)
    policy.reset(**told, instruction=episode.instruction, action_space=space)
    said = f"recorded with {episode.object} .* this episode asks 'Put the pan down'; expected --objects '{OBJECTS[0]}"
    with pytest.raises(InputError, match=said):
        policy.reset(**told, instruction="Put the pan down", action_space=space)


def test_recordings_in_several_control_modes_are_told_apart(copied):
    other = copied.with_name("trajectory.state.pd_ee_delta_pose.h5")
    text = copied.with_suffix(".json").read_text()
    other.with_suffix(".json").write_text(text.replace("pd_joint_pos", "pd_ee_delta_pose"))
    shutil.copy(copied, other)
    copied = copied.rename(copied.with_name("trajectory.state.pd_joint_pos.h5"))
    copied.with_suffix(".json").write_text(text)
    policy, (episode, *_) = RecordedPolicy(str(other.parent)), read_set(copied).episodes
    told = {"task": TASK, "seed": episode.episode_seed, "instruction": episode.instruction}
    for mode in ("pd_joint_pos", "pd_ee_delta_pose"):
        policy.reset(**told, action_space=ActionSpace(-np.ones(8), np.ones(8), mode, 50.0))
    with pytest.raises(InputError, match="its actions are .* or pd_"):
        policy.reset(**told, action_space=ActionSpace(-np.ones(8), np.ones(8), "pd_ee_pose", 50.0))
    other.with_suffix(".json").write_text(text)
    with pytest.raises(InputError, match="both hold seed .* in pd_joint_pos; name one"):
        RecordedPolicy(str(other.parent))


def test_recordings_name_folders_of_objects_by_their_whole_path(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "_attempt", attempting)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my assets").mkdir()
    recorded = record(config(Path("out"), episodes=1, objects=("my assets", "mug_000")))
    assert recorded.env_kwargs["objects"] == [str(tmp_path / "my assets"), "mug_000"]


def test_record_takes_patterns(tmp_path, monkeypatch):
    asked = []

    def ended(config, **options):
        asked.append(config.task)
        raise InputError("enough")

    monkeypatch.setattr(recording, "record", ended)
    words = ["demos", "record", "*/target_pos?", "--out", str(tmp_path / "out"), "--jobs", "1"]
    assert main(words) == 2 and asked == [TASK]


def test_failures_are_kept_with_their_stage_where_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "_attempt", attempting)
    kept = record(config(tmp_path, episodes=3, failures=True))
    assert [each.failure for each in kept.episodes] == [None, "grasp", None, None]


def test_a_task_that_the_baseline_cannot_do_ends_with_one_line(tmp_path, monkeypatch):
    def failing(config, number, seed):
        write_attempt(config, number, seed, "plan", None)
        return False

    monkeypatch.setattr(recording, "_attempt", failing)
    with pytest.raises(InputError, match=r"0 of 2\d attempts, .* 2\d failed in plan: `manipose"):
        record(config(tmp_path))


def test_what_is_refused_before_the_first_attempt_leaves_nothing(tmp_path, monkeypatch):
    def refused(config, number, seed):
        raise InputError("no such object")

    monkeypatch.setattr(recording, "_attempt", refused)
    with pytest.raises(InputError, match="no such object"):
        record(config(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_frozen_seeds_are_refused(tmp_path, monkeypatch):
    frozen = frozen_seeds(TASK)
    assert len(frozen) == 100 + 50  # of v1, and of its list of real scans
    with pytest.raises(InputError, match="is an evaluation seed of a protocol"):
        refuse_frozen(TASK, [5, min(frozen)])
    first = next(config(tmp_path).seeds())
    monkeypatch.setattr(recording, "frozen_seeds", lambda task: {first[1]})
    assert next(config(tmp_path).seeds())[0] == 1


def test_test_objects_are_refused_by_folder_too(tmp_path, capsys):
    def folder(name, item, source):
        path = tmp_path / "assets" / name / "asset.json"
        path.parent.mkdir(parents=True)
        stated = {"name": item, "provenance": {"source": source, "item": item}}
        path.write_text(json.dumps({"schema_version": 1, **stated}))
        return str(path.parent)

    scan = folder("a", "46236", "PartNet-Mobility")
    built_in = folder("b", "mug_004", "procedural catalogue")
    others = [
        folder("c", "46236", "my scans"),
        folder("d", "mug_004", "my scans"),
        folder("e", "mug_003", "procedural catalogue"),
        folder("f", "mug_904", "procedural catalogue"),  # beyond those that are built in
        "mug_003",
    ]
    refuse_test_objects(others)
    told = f"{scan}: 46236 of partnet_mobility is a test object of protocol v1-real"
    for named in (scan, str(tmp_path / "assets")):
        assert (
            main(["demos", "record", TASK, "--out", str(tmp_path / "o"), "--objects", named]) == 2
        )
        (line,) = capsys.readouterr().err.splitlines()
        assert told in line
    with pytest.raises(InputError, match=f"{built_in}: mug_004 is a test object"):
        record(config(tmp_path / "o", objects=(*others, built_in)))
    assert not (tmp_path / "o").exists()


def test_plans_that_nobody_learns_from_may_be_of_test_objects(monkeypatch):
    monkeypatch.setattr(recording, "_attempt", attempting)
    plans = recorded_plans(TASK, "seeds", 1, objects=("mug_004",))
    assert plans.config.objects == ("mug_004",) and len(plans.plans) == 1


READERS = {
    "replay": "demos replay {data} --jobs 1",
    "export": "demos export {data} --out {out}",
    "play": f"evaluate {TASK} --jobs 1 --seed 1 --episodes 1 --hz 50 --objects {' '.join(OBJECTS)} "
    "--policy manipose_mj.demos.playback:RecordedPolicy --out {out} --policy-args",
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda path: path.write_bytes(path.read_bytes()[:3000]), "no whole HDF5 file"),
        (lambda path: path.write_bytes(path.read_bytes()[:-1]), "no whole HDF5 file"),
        (lambda path: path.write_bytes(b"hello"), "no whole HDF5 file"),
        (lambda path: path.unlink(), "no whole HDF5 file|holds no demonstrations"),
        (lambda path: path.with_suffix(".json").unlink(), "no description of demonstrations"),
        (lambda path: path.with_suffix(".json").write_text("{}"), "KeyError: 'env_info'"),
        (lambda path: path.with_suffix(".json").write_text('{"env_'), "no description"),
        (lambda path: _edit(path, env_kwargs={}), "objects is missing; expected null or a list"),
        (lambda path: _edit(path, env_kwargs=None), "objects is missing; expected null or a list"),
        (lambda path: _edit(path, objects="box_000"), "objects is 'box_000'; expected null or a l"),
        (lambda path: _edit(path, split=3), "split is 3; expected a name"),
        (lambda path: _edit(path, episodes=0), "describes no episode"),
        (lambda path: _edit(path, episodes=3), "describes episode 0 twice"),
        (lambda path: _without(path, "traj_1"), "lacks traj_1"),
        (lambda path: _without(path, "traj_0/actions"), "no whole HDF5 file"),
        (lambda path: _without(path, "traj_0/actions", 5), r"has actions of shape \(5, 8\)"),
    ],
)
def test_broken_files_are_one_line_and_exit_code_2(copied, damage, said, reader, tmp_path, capsys):
    damage(copied)
    out = tmp_path / "out"
    words = READERS[reader].format(data=copied.parent, out=out).split()
    if reader == "play":
        words.append(json.dumps({"data": str(copied.parent)}))
    assert main(words) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and re.search(said, lines[0])
    assert reader == "play" or not out.exists()


def _edit(path: Path, **changes: Any) -> None:
    """Change the description: the first `episodes`, of which there are two, and of the environment all else."""
    description = path.with_suffix(".json")
    document = json.loads(description.read_text())
    if "episodes" in changes:
        document["episodes"] = (2 * document["episodes"])[: changes["episodes"]]
    elif "env_kwargs" in changes:
        document["env_info"] |= changes
    else:
        document["env_info"]["env_kwargs"] |= changes
    description.write_text(json.dumps(document))


def _without(path: Path, name: str, kept: int = 0) -> None:
    """Take a group or array out of a file, but for its first rows."""
    with h5py.File(path, "a") as file:
        rows = file[name][:kept] if kept else None
        del file[name]
        if rows is not None:
            file[name] = rows


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (f"record {TASK}s --out {{tmp}}/out", "did you mean single_object/target_pose"),
        ("record --out {tmp}/out", "no task given"),
        (f"record {TASK} --out {{tmp}}/out --episodes 0", "episodes is 0"),
        (f"record {TASK} --out {{tmp}}/out --objects mug_004", "mug_004 is a test object"),
        ("replay {tmp}", "holds no demonstrations"),
        ("replay {demos} --obs-mode state", "need --out"),
        ("replay {demos} --out {tmp}/out", "nothing is new"),
        ("replay {demos} --resume", "--resume needs --out"),
        ("replay {demos} --obs-mode poses --out {tmp}/out", "did you mean pose"),
        ("replay {demos} --control-mode pd_ee --out {tmp}/out", "control mode 'pd_ee'"),
        ("replay {demos} --control-mode primitive --out {tmp}/out", "into whole motions"),
        ("export {demos} --out {tmp}/out --hz 0", "hz is 0"),
        ("export {demos} --out {tmp}/out --obs-mode pose", "expected state+pose"),
        ("export {demos} --out {tmp}", "is there already"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(argv, said, demos, tmp_path, capsys):
    words = argv.format(tmp=tmp_path, demos=demos.path.parent).split()
    assert main(["demos", *words]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and said in lines[0]
    assert not (tmp_path / "out").exists()


@pytest.mark.full
def test_a_kill_loses_the_running_episode_at_most(tmp_path):
    words = ["demos", "record", TASK, "--episodes", "4", "--jobs", "1", "--objects", *OBJECTS]
    command = [sys.executable, "-W", "ignore", "-m", "manipose_mj.cli.main", *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    out = tmp_path / "out"
    process = subprocess.Popen([*command, "--out", str(out)], env=environment)
    parts = config(out).parts
    deadline = time.monotonic() + 120
    while len(list(parts.glob("0*.json"))) < 2:
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    kept = {file.name: file.stat().st_mtime_ns for file in parts.glob("0*.json")}
    assert len(kept) >= 2
    asked = config(out, episodes=4)
    resumed = record(asked, resume=True)
    whole = record(config(tmp_path / "whole", episodes=4))
    assert resumed.episodes == whole.episodes
    assert read_set(resumed.path).episodes == whole.episodes
    assert resumed.path.read_bytes() == whole.path.read_bytes()
