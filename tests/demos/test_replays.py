"""Replays: bit for bit, with observations, in other control modes, under other versions."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import h5py
import numpy as np
import pytest

from manipose_mj.cli.main import main
from manipose_mj.demos.layout import current_versions, find_sets, read_set, write_description
from manipose_mj.demos.observation_tape import ObservationTape
from manipose_mj.demos.record import record
from manipose_mj.demos.replay import (
    ReplayConfig,
    differing_versions,
    lost,
    replay,
    replayed_before,
)
from manipose_mj.errors import InputError
from tests.demos.recordings import config

SIZE = 32  # pixels; of the features it is 224
STEPS = 25


def test_replays_are_bit_identical(demos):
    results = replay(demos, ReplayConfig())
    assert [each.identical for each in results] == [True, True] and lost(results) == 0
    assert differing_versions(demos) == []
    older = replace(demos, versions={**demos.versions, "numpy": "1.0"})
    assert differing_versions(older)[0].startswith("numpy 1.0 -> ")


def test_a_folder_of_a_recording_and_its_replays_is_the_recording(copied):
    """As `manipose demos replay DIR --control-mode MODE --out DIR` leaves it."""
    name = "trajectory.none.pd_ee_pose.mujoco_cpu"
    for kind in (".h5", ".json"):
        shutil.copy(copied.with_suffix(kind), copied.with_name(name + kind))
    assert [each.path for each in find_sets(copied.parent)] == [copied]
    copied.unlink()
    assert [each.path.stem for each in find_sets(copied.parent)] == [name]


def test_a_resumed_replay_leaves_out_what_is_whole(copied, demos, tmp_path, capsys):
    out = tmp_path / "new"
    asked = ReplayConfig("", "pd_ee_pose", out)
    assert replayed_before(demos, asked) is None
    path = asked.path(demos)
    path.parent.mkdir(parents=True)
    shutil.copy(copied, path)
    write_description(replace(read_set(copied), path=path))
    with pytest.raises(InputError, match="is of other demonstrations"):
        replayed_before(demos, asked)
    write_description(replace(read_set(copied), path=path, replayed=2))
    words = ["demos", "replay", str(demos.path), "--control-mode", "pd_ee_pose", "--jobs", "1"]
    before = path.read_bytes()
    assert main([*words, "--out", str(out)]) == 2
    assert "is there already; add --resume" in capsys.readouterr().err
    assert main([*words, "--out", str(out), "--resume"]) == 0
    assert "2 are there already" in capsys.readouterr().out and path.read_bytes() == before
    with pytest.raises(InputError, match="is of other demonstrations"):
        replayed_before(replace(demos, episodes=demos.episodes[:1]), asked)


def test_a_refused_replay_leaves_no_folder(demos, tmp_path, monkeypatch):
    def refusing(*arguments):
        raise InputError("pd_ee_delta_pos: cannot turn the hand")

    monkeypatch.setattr("manipose_mj.demos.replay.replay_one", refusing)
    (tmp_path / "there").mkdir()
    for out in (tmp_path / "there", tmp_path / "new" / "deeper"):
        with pytest.raises(InputError, match="cannot turn the hand"):
            replay(demos, ReplayConfig("", "pd_ee_delta_pos", out))
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


@pytest.mark.full
def test_a_replay_adds_observations_and_converts(demos, tmp_path):
    asked = ReplayConfig("state+pose", "pd_ee_delta_pose", tmp_path)
    results = replay(demos, asked)
    (new,) = find_sets(tmp_path)
    assert new.path.name == "trajectory.state+pose.pd_ee_delta_pose.mujoco_cpu.h5"
    assert len(new.episodes) + lost(results) == 2 and new.episodes
    episode = new.episodes[0]
    with h5py.File(new.path) as file:
        group = file[f"traj_{episode.episode_id}"]
        assert group["actions"].shape == (episode.elapsed_steps, 7)
        for name, width in (("agent_pos", 17), ("environment_state", 20)):
            assert group[f"obs/{name}"].shape == (episode.elapsed_steps + 1, width)
        assert (np.diff(group["obs/agent_pos"][:, 8:11], axis=0) != 0).any()
    grown = replace(asked, out=tmp_path / "grown")
    replay(replace(demos, episodes=demos.episodes[:1]), grown)
    before = replayed_before(demos, grown)
    assert before is not None and before.replayed == 1
    assert replay(demos, grown, before) == results[1:]
    after = read_set(before.path)
    assert after.document == new.document and after.replayed == 2
    assert after.path.read_bytes() == new.path.read_bytes()
    with pytest.raises(InputError, match="is there already"):
        replay(demos, asked)
    with pytest.raises(InputError, match="is a replay already"):
        replay(new, replace(asked, out=tmp_path / "again"))


@pytest.mark.full
def test_pictures_and_clouds_are_added_by_the_command(copied, tmp_path, monkeypatch, capsys):
    """Of the beginnings of two episodes, for each step takes its time; their goals count as met."""
    shorten(copied, STEPS)
    monkeypatch.setattr("manipose_mj.tasks.core.task.success", lambda *goals: True)
    monkeypatch.setattr("manipose_mj.gym.features.IMAGE_SIZE", SIZE)
    words = ["--obs-mode", "rgb+pointcloud", "--control-mode", "pd_ee_delta_pose", "--jobs", "1"]
    out = tmp_path / "seen"
    assert main(["demos", "replay", str(copied.parent), *words, "--out", str(out)]) == 0
    (new,) = find_sets(out)
    assert "2 replayed, 2 succeed, 0 successes lost" in capsys.readouterr().out
    assert new.path.name == "trajectory.rgb+pointcloud.pd_ee_delta_pose.mujoco_cpu.h5"
    assert new.env_kwargs["obs_mode"] == "rgb+pointcloud" and len(new.episodes) == 2
    for episode in new.episodes:
        with h5py.File(new.path) as file:
            group = file[f"traj_{episode.episode_id}"]
            steps = episode.elapsed_steps
            assert steps >= STEPS
            assert group["actions"].shape == (steps, 7) and len(group["success"]) == steps
            for camera in ("front", "wrist"):
                pictures = group[f"obs/pixels/{camera}"]
                assert pictures.shape == (steps + 1, SIZE, SIZE, 3) and pictures.dtype == np.uint8
                assert np.std(pictures[-1]) > 5 and (pictures[0] != pictures[-1]).any()
            points = group["obs/pointcloud/points"]
            assert points.shape[0] == steps + 1 and np.abs(points[-1]).max() > 0
            counts = np.asarray(group["obs/pointcloud/object/count"])
            assert counts.shape == (steps + 1, 1) and counts[0] > 0


def shorten(path, steps):
    """Keep the first steps of a set's episodes."""
    with h5py.File(path, "a") as file:
        for group in file.values():
            actions = np.asarray(group["actions"])[:steps]
            del group["actions"]
            group["actions"] = actions
    description = path.with_suffix(".json")
    document = json.loads(description.read_text())
    for episode in document["episodes"]:
        episode["elapsed_steps"] = steps
    description.write_text(json.dumps(document))


def test_observations_wait_in_memory_for_a_few_steps_only(tmp_path):
    rng = np.random.default_rng(0)
    shown = [{"a/b": rng.random((2, 3)), "n": np.arange(0), "instruction": "x"} for _ in range(40)]
    with h5py.File(tmp_path / "part.h5", "w") as file:
        tape = ObservationTape(file.create_group("traj_0/obs"))
        for number, each in enumerate(shown, start=1):
            tape.append(each)
            written = len(file["traj_0/obs/a/b"]) if number >= 16 else 0
            assert number - 16 < written <= number
        tape.flush()
        tape.flush()
        assert sorted(file["traj_0/obs"]) == ["a", "n"] and file["traj_0/obs/n"].shape == (40, 0)
        np.testing.assert_array_equal(file["traj_0/obs/a/b"], [each["a/b"] for each in shown])


@pytest.mark.full
def test_a_record_does_not_depend_on_jobs(demos, tmp_path):
    again = record(config(tmp_path, jobs=2))
    assert again.episodes == demos.episodes
    assert again.path.read_bytes() == demos.path.read_bytes()


@pytest.mark.full
def test_a_replay_under_other_versions_warns_and_counts_what_is_lost(copied, capsys):
    with h5py.File(copied, "a") as file:
        actions = file["traj_1/actions"]
        actions[...] = actions[:1]  # as if its goal were not met any more
    words = ["demos", "replay", str(copied), "--jobs", "1"]
    assert main(words) == 1  # the same versions: it ought to repeat
    said = capsys.readouterr()
    assert "2 replayed, 1 bit for bit, 1 succeed, 1 successes lost" in said.out
    assert "other versions" not in said.err

    description = copied.with_suffix(".json")
    document = json.loads(description.read_text())
    document["versions"]["numpy"] = "1.0"
    description.write_text(json.dumps(document))
    assert main(words) == 0
    said = capsys.readouterr()
    assert "1 succeed, 1 successes lost" in said.out
    now = current_versions()["numpy"]
    assert f"recorded with other versions: numpy 1.0 -> {now}" in " ".join(said.err.split())
