"""ManiSkill's own loader reads replayed demonstrations, where `make conformance-maniskill` has installed it."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from manipose_mj.demos.record import RecordConfig, record
from manipose_mj.demos.replay import ReplayConfig, replay
from tests.places import ROOT

# An environment of its own: ManiSkill brings SAPIEN, PyTorch and its own choice of versions.
PYTHON = Path(os.environ.get("MANISKILL_PYTHON", ROOT / ".venv-maniskill/bin/python"))
READER = Path(__file__).with_name("maniskill_reader.py")
OBJECTS = ("mug_000", "chips_can_000", "box_000")


@pytest.fixture(scope="module")
def demos(tmp_path_factory):
    if not PYTHON.is_file():
        pytest.skip(f"no ManiSkill at {PYTHON}: make conformance-maniskill installs it")
    asked = RecordConfig(
        "single_object/target_pose",
        tmp_path_factory.mktemp("demos"),
        episodes=2,
        objects=OBJECTS,
    )
    return record(asked)


@pytest.mark.parametrize(
    ("obs_mode", "control_mode"),
    [("state+pose", "pd_ee_delta_pose"), ("pointcloud", "pd_joint_pos")],
)
def test_maniskills_loader_reads_a_replayed_file(demos, obs_mode, control_mode, tmp_path):
    results = replay(demos, ReplayConfig(obs_mode, control_mode, tmp_path))
    assert all(each.now is not None for each in results)
    (path,) = tmp_path.rglob("trajectory.*.h5")
    done = subprocess.run(
        [str(PYTHON), str(READER), str(path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    read = json.loads(done.stdout.splitlines()[-1])
    with h5py.File(path) as file:
        groups = [file[f"traj_{each.episode.episode_id}"] for each in results]
        actions = np.concatenate([np.asarray(group["actions"]) for group in groups])
        names: list[str] = []
        groups[0]["obs"].visititems(
            lambda name, each: names.append(name) if isinstance(each, h5py.Dataset) else None
        )
        assert sorted(read["observations"]) == sorted(names) and names
        for name, (shape, _) in read["observations"].items():
            assert shape == [8, *groups[0]["obs"][name].shape[1:]]
    assert read["frames"] == len(actions) and read["env_id"] == "manipose_mj/TargetPose-v0"
    np.testing.assert_allclose(read["actions"], actions.sum(axis=0), rtol=1e-6)
    assert read["batch"]["action"][0] == [8, actions.shape[1]]
