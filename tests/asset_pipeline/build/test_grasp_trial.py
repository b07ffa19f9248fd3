"""Trials in simulation: what holds, what fails, in which order, and twice the same."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from asset_pipeline.build.grasp_trial import Trial, TrialConfig, with_trials
from asset_pipeline.build.scratch_model import scratch_model
from asset_pipeline.catalogue.instance import build
from asset_pipeline.geometry.mass import shape_mass_properties
from asset_pipeline.geometry.stable_poses import stable_poses, verified
from asset_pipeline.procedural.revolution import wall_wedges
from manipose_mj.assets.asset import MIN_HELD, GraspSet
from manipose_mj.assets.geometry import Body, MassProperties, Shape
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.assets.label import PoseLabel
from manipose_mj.grasp_sampling.sampler import sample_grasps
from manipose_mj.poses import SymmetryGroup, compose

FINE = TrialConfig(
    timestep=0.002, close_time=0.5, lift=0.15, lift_time=0.4, shake=0.03, frequency=3.0
)

# X is the frame's z.
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
ROUND = PoseLabel(np.zeros(3), UPRIGHT, "axial", np.ones(3), SymmetryGroup.about_x())


def _body(*shapes, mass):
    own = shape_mass_properties(shapes, 1000.0)
    scaled = MassProperties(mass, own.center_of_mass, own.inertia * mass / own.mass)
    return Body("thing", shapes, shapes, scaled)


def _vessel(foot, rim, height, wall, mass):
    """An open vessel of 24 wall segments on a 4 mm bottom."""
    outside = np.array([[foot, 0.0], [rim, height]])
    walls = wall_wedges(outside, outside - [wall, 0.0], 24)
    bottom = compose(np.eye(3), np.array([0.0, 0.0, 0.002]))
    return _body(Shape("cylinder", (foot - wall, 0.002), bottom), *walls, mass=mass)


BODIES = {
    "fork": _body(Shape("box", (0.09, 0.0075, 0.00125)), mass=0.05),
    "pencil": _body(Shape("cylinder", (0.004, 0.0875)), mass=0.006),
    "notebook": _body(Shape("box", (0.105, 0.074, 0.003)), mass=0.12),
    "plate": _vessel(0.08, 0.12, 0.022, 0.004, mass=0.45),
    "pot": _vessel(0.10, 0.10, 0.11, 0.003, mass=0.3),
    "helmet": _vessel(0.13, 0.13, 0.14, 0.025, mass=0.4),
    "box": _body(Shape("box", (0.02, 0.03, 0.06)), mass=0.2),
}


@pytest.fixture(scope="module")
def tried():
    """Name -> body, stable poses, sampled grasps, the same after trials."""
    found = {}
    for name, body in BODIES.items():
        touching = trimesh.util.concatenate([s.surface(96) for s in body.collision])
        label = ROUND if name == "pencil" else None
        poses = stable_poses(touching, body.mass_properties.center_of_mass, label=label)[:2]
        with scratch_model(body) as path:
            poses = verified(poses, path, label=label)
            sampled = sample_grasps(body, poses)
            found[name] = body, poses, sampled, with_trials(sampled, poses, path)
    return found


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", BODIES)
def test_thin_and_wide_objects_are_graspable(tried, name):
    """Cutlery lying flat, pens, books, and what is too wide in all but its rim."""
    _, _, sampled, grasps = tried[name]
    assert sampled.tried is None and sampled.graspable is None
    assert MIN_HELD <= grasps.held <= grasps.tried <= 60 and grasps.graspable
    assert len(grasps) == len(sampled) - (grasps.tried - grasps.held)


@pytest.mark.parametrize("name", ["plate", "pot", "helmet"])
def test_wide_vessels_are_held_by_the_wall(tried, name):
    _, _, _, grasps = tried[name]
    assert (grasps.widths[: grasps.held] < 0.03).all()


def test_a_pencil_is_picked_off_the_table(tried):
    _, _, _, grasps = tried["pencil"]
    assert grasps.clear.any(axis=1).sum() >= 10


def test_the_grasps_that_held_come_first_and_are_of_every_side(tried):
    body, poses, _, grasps = tried["box"]
    with scratch_model(body) as path:
        trial = Trial(path, ParallelJaw(), TrialConfig())
        held = [trial.run(grasps, k, poses).held(TrialConfig()) for k in range(grasps.held)]
    assert all(held)
    assert len(np.unique(np.round(grasps.poses[: grasps.held, :3, 2]), axis=0)) >= 4


@pytest.mark.parametrize("name", ["box", "fork", "pot"])
def test_a_finer_and_longer_trial_agrees(tried, name):
    body, poses, _, grasps = tried[name]
    with scratch_model(body) as path:
        trial = Trial(path, ParallelJaw(), FINE)
        held = [trial.run(grasps, k, poses).held(FINE) for k in range(0, grasps.held, 3)]
    assert np.mean(held) > 0.85


def test_what_is_too_heavy_or_slippery_is_not_held(tried):
    """No grasp of a 12 kg block holds, and nobody tries on once the object cannot become graspable."""
    body, poses, sampled, _ = tried["box"]
    own = body.mass_properties
    heavy = replace(body, mass_properties=replace(own, mass=12.0, inertia=own.inertia * 60))
    with scratch_model(heavy) as path:
        grasps = with_trials(sampled, poses, path)
    assert grasps.held == 0 and grasps.tried == 60 - MIN_HELD + 1 and grasps.graspable is False
    assert len(grasps) == len(sampled) - grasps.tried


def test_a_hand_that_starts_in_contact_has_failed(tried):
    body, poses, sampled, _ = tried["box"]
    deep = sampled.poses @ compose(np.eye(3), np.array([0.0, 0.0, 0.08]))
    with scratch_model(body) as path:
        trial = Trial(path, ParallelJaw(), TrialConfig())
        outcome = trial.run(replace(sampled, poses=deep), 0, poses)
    assert np.isinf(outcome.slip) and not outcome.held(TrialConfig())


def test_no_grasps_are_no_grasps(tried):
    body, poses, _, _ = tried["box"]
    none = GraspSet(np.empty((0, 4, 4)), np.empty(0), np.empty((0, len(poses)), bool))
    with scratch_model(body) as path:
        grasps = with_trials(none, poses, path)
    assert (grasps.held, grasps.tried, grasps.graspable, len(grasps)) == (0, 0, False, 0)


_BUILD = """
import sys
from asset_pipeline.catalogue.instance import build
build("mug", 1, sys.argv[1])
"""


def test_two_processes_write_the_same_bytes(tmp_path):
    subprocess.run([sys.executable, "-c", _BUILD, tmp_path / "one"], check=True)
    build("mug", 1, tmp_path / "two")
    files = sorted(p.relative_to(tmp_path / "one") for p in (tmp_path / "one").rglob("*.*"))
    assert "grasps.json" in map(str, files)
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()
    assert sum((tmp_path / "one" / file).stat().st_size for file in files) < 300_000


@pytest.mark.parametrize("name", ["hand", "left", "right", "finger_left", "hand_x"])
def test_an_object_may_have_the_name_of_what_holds_it(name):
    body = replace(BODIES["box"], name=name)
    with scratch_model(body) as path:
        Trial(path, ParallelJaw(), TrialConfig())
