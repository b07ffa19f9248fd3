"""Recordings say the same in every control mode, and repeat bit for bit."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dm_control import composer

from manipose_mj.actions import CONTROL_MODES, control_mode
from manipose_mj.assets import catalogue
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.conversion.convert import convert
from manipose_mj.control.conversion.recording import Recording, record, replay
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from tests.few_objects import load

SCRIPT = Path(__file__).parents[3] / "benchmarks" / "experiments" / "trajectory_conversion.py"
# Of the TCP at the end of a converted recording [m]; ends wait for the arm.
END = 0.002


def _environment(category: str) -> composer.Environment:
    objects = [catalogue.load(category, 0)]
    return load("single_object", "target_pose", seed=0, obs_mode="state", objects=objects)


@pytest.fixture(scope="module")
def script():
    """The benchmark as a module; benchmarks are no package."""
    spec = importlib.util.spec_from_file_location("trajectory_conversion", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def cans() -> composer.Environment:
    return _environment("chips_can")


@pytest.fixture(scope="module")
def transport(script, cans) -> Recording:
    """A success that does not turn the hand."""
    return next(script.straight_carries(cans, 0))


@pytest.fixture(scope="module")
def reach(cans, transport) -> Recording:
    """The first steps of the transport."""
    return record(cans, transport.actions[:90], seed=transport.seed)


@pytest.fixture(scope="module")
def boxes() -> composer.Environment:
    return _environment("box")


@pytest.fixture(scope="module")
def placed(boxes) -> Recording:
    """A success of the baseline."""
    boxes.reset()
    baseline = Baseline(boxes)
    recording = record(boxes, baseline.actions(0), seed=0)
    assert recording.success
    return recording


@pytest.mark.full
@pytest.mark.parametrize("mode", CONTROL_MODES[1:])
def test_every_mode_goes_where_the_recording_went(cans, reach, mode):
    replay(cans, reach)
    end = cans.task.robot.tcp_pose(cans.physics)[:3, 3]
    converted = convert(cans, reach, mode)
    assert (converted.mode, converted.seed, converted.success) == (mode, reach.seed, False)
    spec = control_mode(mode).spec()
    assert len(converted.actions) < 1.2 * len(reach.actions)
    assert (converted.actions >= spec.minimum - 1e-9).all()
    assert (converted.actions <= spec.maximum + 1e-9).all()
    np.testing.assert_allclose(cans.task.robot.tcp_pose(cans.physics)[:3, 3], end, atol=END)


@pytest.mark.full
@pytest.mark.parametrize("mode", ["pd_joint_vel", "pd_ee_delta_pos", "pd_ee_target_delta_pos"])
def test_a_carry_is_one_in_modes_far_from_its_own(cans, transport, mode):
    assert convert(cans, transport, mode).success


@pytest.mark.full
def test_a_success_of_the_baseline_is_one_in_another_mode_and_back(boxes, placed):
    converted = convert(boxes, placed, "pd_ee_delta_pose")
    assert converted.success
    assert convert(boxes, converted, "pd_joint_pos").success


@pytest.mark.full
@pytest.mark.parametrize("mode", ["pd_joint_vel", "pd_ee_target_delta_pose"])
def test_a_converted_recording_repeats_bit_for_bit(cans, reach, mode):
    converted = convert(cans, reach, mode)
    end = cans.physics.get_state()
    assert replay(cans, converted) == converted.success
    np.testing.assert_array_equal(cans.physics.get_state(), end)


@pytest.mark.full
def test_the_modes_of_an_environment_stay_its_own(cans, reach):
    usual = cans.task.control_mode
    convert(cans, replace(reach, actions=reach.actions[:5]), "pd_ee_pose")
    assert cans.task.control_mode is usual
    with pytest.raises(InputError, match="did you mean"):
        convert(cans, reach, "pd_ee_poes")
    assert cans.task.control_mode is usual


@pytest.mark.sample(1)
@pytest.mark.parametrize("mode", ["pd_ee_delta_pos", "pd_ee_target_delta_pos"])
def test_turns_are_refused_where_they_cannot_be_said(boxes, placed, mode):
    with pytest.raises(InputError, match=f"turns the hand by .* deg, which {mode} cannot"):
        convert(boxes, replace(placed, actions=placed.actions[:250]), mode)


def test_a_motion_too_fast_for_a_mode_slows_down(cans):
    goal = HOME + np.array([0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5])
    fast = np.linspace(HOME, goal, 16)[1:]  # 2.7 rad/s
    actions = [np.append(q, MAX_OPENING) for q in [*fast, *[goal] * 30]]
    recording = record(cans, actions, seed=1)
    end = cans.task.robot.tcp_pose(cans.physics)[:3, 3]
    for mode, longer in (("pd_joint_vel", 15), ("pd_joint_pos_vel", 0)):
        converted = convert(cans, recording, mode)
        assert len(converted.actions) >= len(actions) + longer, mode
        np.testing.assert_allclose(cans.task.robot.tcp_pose(cans.physics)[:3, 3], end, atol=END)


def test_an_action_that_does_not_fit_is_refused(cans):
    with pytest.raises(InputError, match="pd_ee_pose"):
        record(cans, [np.zeros(8)], seed=0, mode="pd_ee_pose")
