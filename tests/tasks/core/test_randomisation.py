"""Domain randomisation: named, off by default, repeatable, of the stated size."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.ray_casting import geom_colours
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.tasks.core.randomisation import STRENGTHS, Delay
from manipose_mj.tasks.core.snapshot import restore, save
from tests.few_objects import load

TASK = ("single_object", "target_pose")
ONE = ("mug_000",)  # so that models can be compared
HOLD = np.append(HOME, MAX_OPENING)
FIELDS = {
    "geom_friction": "friction",
    "body_mass": "mass",
    "actuator_gainprm": "gains",
    "light_diffuse": "light",
    "light_pos": "light_shift",
    "geom_rgba": "colour",
    "cam_pos": "camera_shift",
    "cam_quat": "camera_turn",
}


@pytest.fixture(scope="module")
def environments():
    found = {
        name: load(*TASK, seed=0, objects=ONE, obs_mode="state", randomisation=name)
        for name in STRENGTHS
    }
    for environment in found.values():
        environment.reset()
    return found


def _fields(environment) -> dict[str, np.ndarray]:
    return {name: np.array(getattr(environment.physics.model, name)) for name in FIELDS}


def test_it_is_off_by_default(environments):
    plain = load(*TASK, seed=0, objects=ONE, obs_mode="state")
    plain.reset()
    before = _fields(plain)
    plain.reset()
    for name, values in _fields(plain).items():
        np.testing.assert_array_equal(values, before[name])
        np.testing.assert_array_equal(values, getattr(environments["none"].physics.model, name))


@pytest.mark.parametrize("name", ["mild", "strong"])
def test_all_that_is_named_changes_within_its_strength(environments, name):
    environment, nominal = environments[name], _fields(environments["none"])
    strength, seen = STRENGTHS[name], []
    for seed in range(12):
        environment.random_state.seed(seed)
        environment.reset()
        seen.append(_fields(environment))
    for field in FIELDS:
        values = np.stack([s[field] for s in seen])
        assert np.ptp(values, axis=0).max() > 0, field
        assert not np.array_equal(values[0], nominal[field]), field
    for field, most in (
        ("geom_friction", strength.friction),
        ("body_mass", strength.mass),
        ("actuator_gainprm", strength.gains),
        ("light_diffuse", strength.light),
    ):
        base = nominal[field]
        ratios = np.stack([s[field][base > 0] / base[base > 0] for s in seen])
        assert ratios.max() < most + 1e-9 and ratios.min() > 1 / most - 1e-9, field
        assert ratios.max() > 1 + 0.5 * (most - 1), field  # all of the range is used
    shift = np.stack([s["cam_pos"] - nominal["cam_pos"] for s in seen])
    assert 0.6 * strength.camera_shift < shift.std() < 1.4 * strength.camera_shift


def test_colours_change_by_what_is_named_where_materials_give_them(environments):
    nominal = geom_colours(environments["none"].physics.model.ptr)
    environment, changes = environments["strong"], []
    by_material = np.array(environment.physics.model.geom_matid) >= 0
    for seed in range(6):
        environment.random_state.seed(seed)
        environment.reset()
        changes.append(geom_colours(environment.physics.model.ptr) - nominal)
    changed = np.stack(changes)[:, by_material, :3]
    assert by_material.sum() > 20
    assert np.abs(changed).max() > 0 and abs(changed.mean()) < 0.05
    assert changed.std() < 1.2 * STRENGTHS["strong"].colour


def test_finger_pads_keep_their_friction(environments):
    pads = environments["strong"].task.robot.pad_geoms
    for name in ("none", "strong"):
        physics = environments[name].physics
        pads = physics.bind(environments[name].task.robot.pad_geoms).element_id
        friction = physics.model.geom_friction[pads]
        if name == "none":
            nominal = np.array(friction)
    np.testing.assert_array_equal(friction, nominal)


def test_strengths_do_not_pile_up(environments):
    environment = environments["strong"]
    masses = []
    for seed in (4, 5, 6, 4):
        environment.random_state.seed(seed)
        environment.reset()
        masses.append(np.array(environment.physics.model.body_mass))
    np.testing.assert_array_equal(masses[0], masses[3])
    assert not np.array_equal(masses[0], masses[1])


def test_the_same_seed_gives_the_same_world_and_episode():
    runs = []
    for _ in range(2):
        environment = load(*TASK, seed=7, obs_mode="state", randomisation="strong")
        environment.reset()
        for _ in range(10):
            environment.step(HOLD)
        runs.append(np.array(environment.physics.data.qpos))
    np.testing.assert_array_equal(*runs)


def test_the_robot_holds_still_and_objects_stay_put(environments):
    environment = environments["strong"]
    for seed in range(3):
        environment.random_state.seed(seed)
        environment.reset()
        before = np.array(environment.physics.data.qpos)
        for _ in range(50):
            environment.step(HOLD)
        assert np.abs(environment.physics.data.qpos[:9] - before[:9]).max() < 5e-3


def test_targets_come_late_and_are_restored_under_way():
    delay = Delay()
    delay.start(3, np.zeros(8))
    arrived = [delay.through(np.full(8, float(i)))[0] for i in range(1, 7)]
    assert arrived == [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]
    environment = load(*TASK, seed=1, obs_mode="state", randomisation="strong")
    environment.reset()
    assert len(environment.task._delay.waiting) > 0
    moved = HOLD + np.append(np.full(7, 0.1), -0.02)
    environment.step(moved)
    snapshot = save(environment)
    environment.step(HOLD)
    later = np.array(environment.physics.data.qpos)
    environment.reset()
    restore(environment, snapshot)
    environment.step(HOLD)
    np.testing.assert_array_equal(environment.physics.data.qpos, later)


def test_unknown_strengths_are_refused():
    with pytest.raises(InputError, match="unknown randomisation 'stron'; did you mean strong"):
        suite.load(*TASK, randomisation="stron")
