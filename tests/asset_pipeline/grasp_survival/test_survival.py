"""Survival of grasps: the trials of the pipeline's own check, other frictions, and the file beside the asset."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from asset_pipeline.build import grasp_trial
from asset_pipeline.build.grasp_trial import Trial, TrialConfig
from asset_pipeline.cli.grasps import try_grasps
from asset_pipeline.grasp_survival.engine_c import held_c
from asset_pipeline.grasp_survival.grid import GridConfig, trial_grid
from asset_pipeline.grasp_survival.survival import (
    SURVIVAL_FILE,
    grasp_survival,
    read_survival,
    rigid_assets,
    summarised,
    write_survival,
)
from asset_pipeline.grasp_survival.trial_model import GridTrial, motion
from manipose_mj.assets import catalogue
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.errors import InputError

CONFIG, HAND = TrialConfig(), ParallelJaw()
FEW = GridConfig(frictions=(0.05, 1.0), places=2)


@pytest.fixture(scope="module")
def asset(tmp_path_factory):
    """A box whose file has its first and last grasps alone."""
    built = catalogue.load_by_name("box_000")
    folder = tmp_path_factory.mktemp("assets") / "box_000"
    shutil.copytree(built.folder, folder)
    path = folder / "grasps.json"
    document = json.loads(path.read_text())
    for name in ("poses", "widths", "clear"):
        document[name] = document[name][:2] + document[name][-2:]
    path.write_text(json.dumps(document | {"held": 2, "tried": 2}))
    return read_asset(folder)


def test_a_hand_at_its_place_with_the_pads_own_friction_is_the_pipelines_trial(asset):
    grid = trial_grid(asset.grasps, asset.stable_poses, HAND, FEW)
    assert len(grid) == 4 * 4 and grid.exact.sum() == 4 * 2
    trial, own = Trial(asset.model_path, HAND, CONFIG), GridTrial(asset.model_path, HAND, CONFIG)
    for row in np.flatnonzero(grid.exact & (grid.frictions == 1.0)):
        expected = trial.run(asset.grasps, int(grid.grasp[row]), asset.stable_poses)
        found = own.outcome(grid, int(row))
        np.testing.assert_allclose(found.slip, expected.slip, atol=1e-6)
        np.testing.assert_allclose(found.turn, expected.turn, atol=1e-5)


def test_slippery_pads_drop_what_others_hold(asset):
    grid = trial_grid(asset.grasps, asset.stable_poses, HAND, FEW)
    held = held_c(asset.model_path, grid, HAND, CONFIG)
    assert held[grid.frictions == 1.0].mean() > held[grid.frictions == 0.05].mean()


def test_the_motion_is_that_of_the_pipelines_trial():
    direction = np.array([0.6, 0.0, 0.8])
    up, aside = motion(CONFIG)
    expected = grasp_trial._motion(direction, CONFIG)
    np.testing.assert_allclose(up[:, None] * direction + aside, expected, atol=1e-12)


def test_trials_without_room_do_not_count(asset):
    grid = trial_grid(asset.grasps, asset.stable_poses, HAND, FEW)
    held, counts = np.ones(len(grid), bool), grid.grasp != 1
    held[grid.grasp == 2] = grid.frictions[grid.grasp == 2] == 1.0
    found = summarised(grid, held, counts, 4, "warp")
    np.testing.assert_array_equal(found.trials, [4, 0, 4, 4])
    np.testing.assert_array_equal(found.probability, [1, np.nan, 0.5, 1])
    np.testing.assert_array_equal(found.verdict, [True, False, True, True])


def test_the_file_lies_beside_the_asset_and_readers_pass_over_it(asset):
    found = grasp_survival(asset, "c", GridConfig(frictions=(1.0,), places=1))
    path = write_survival(asset, found, FEW)
    again = read_survival(read_asset(asset.folder))
    assert path.name == SURVIVAL_FILE and again is not None
    np.testing.assert_allclose(again.probability, found.probability)
    np.testing.assert_array_equal(again.verdict, found.verdict)
    fewer = replace(asset.grasps, poses=asset.grasps.poses[:1], widths=asset.grasps.widths[:1])
    with pytest.raises(InputError, match="of 4 grasps; the asset has 1"):
        read_survival(replace(asset, grasps=fewer))


def test_the_command_writes_the_file(asset, capsys):
    try_grasps(asset.folder, engine="c", frictions=(1.0,), places=1, jobs=1)
    assert "box_000" in capsys.readouterr().out
    assert json.loads((asset.folder / SURVIVAL_FILE).read_text())["trials"] == [1, 1, 1, 1]


def test_wrong_input_is_one_line(tmp_path):
    with pytest.raises(InputError, match="expected one or more above 0"):
        GridConfig(frictions=(0.0,))
    with pytest.raises(InputError, match="seed is -1; expected a whole number, at least 0"):
        GridConfig(seed=-1)
    with pytest.raises(InputError, match="no such folder"):
        rigid_assets(tmp_path / "nothing")


@pytest.mark.full
def test_engine_warp_comes_to_the_same_verdicts(asset):
    pytest.importorskip("mujoco_warp", reason='needs pip install -e ".[gpu]"')
    from asset_pipeline.grasp_survival.engine_warp import Batch, held_warp

    grid = trial_grid(asset.grasps, asset.stable_poses, HAND, FEW)
    trial = GridTrial(asset.model_path, HAND, CONFIG)
    expected = held_c(asset.model_path, grid, HAND, CONFIG)
    held, counts = held_warp(trial, grid)
    assert counts.all()
    assert (held == expected).mean() >= 0.9
    # Worlds that try one after another come to what each alone comes to.
    again, counts = Batch(trial, 5).held(grid)
    assert counts.all()
    np.testing.assert_array_equal(again, held)


@pytest.mark.full
def test_trials_without_room_are_tried_again_with_more(asset):
    pytest.importorskip("mujoco_warp", reason='needs pip install -e ".[gpu]"')
    from asset_pipeline.grasp_survival.engine_warp import Batch, Room

    grid = trial_grid(asset.grasps, asset.stable_poses, HAND, FEW).part(slice(0, 4))
    trial = GridTrial(asset.model_path, HAND, CONFIG)
    held, counts = Batch(trial, 2, Room(contacts=1, rows=8)).held(grid)
    assert counts.all()
    np.testing.assert_array_equal(held, held_c(asset.model_path, grid, HAND, CONFIG))


def test_what_builds_assets_does_not_load_the_gpu_libraries():
    code = "import asset_pipeline.grasp_survival.survival, sys; assert 'warp' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
