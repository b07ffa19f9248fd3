"""Dense rewards: within [0, 1], 1 for success alone, rising along what succeeds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import spearmanr

from manipose_mj import suite
from manipose_mj.control.baseline import Baseline
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, compose, rotation_about
from manipose_mj.tasks.goals import (
    InsideGoal,
    OnTableGoal,
    OpenGoal,
    PoseGoal,
    ShutGoal,
    Tolerance,
    progress,
)
from manipose_mj.tasks.scene.state import ObjectState, PartState, SceneState
from tests.few_objects import load

TOLERANCE = Tolerance()
BOX = (np.array([0.1, 0.06, 0.06]), SymmetryGroup.identity())
DRAWER = (np.array([0.0, 0.2]), np.array([0.3, 0.2, 0.1]), np.asarray(True))
GOAL = PoseGoal("box", compose(np.eye(3), np.array([0.5, 0.0, 0.05])))
STORE = (InsideGoal("box", "drawer"), ShutGoal("drawer"))


def _state(at, tcp, *, turn=0.0, held=False, touched=None, speed=0.0, opening=0.0) -> SceneState:
    pose = compose(rotation_about(np.array([0.0, 0.0, 1.0]), turn), np.array(at, float))
    tcp_pose = compose(np.eye(3), np.array(tcp, float))
    touched = held if touched is None else touched
    flags = {"touched": np.asarray(touched), "held": np.asarray(held)}
    box = ObjectState(*BOX, pose, np.asarray(speed), np.asarray(speed), **flags)
    cavity = compose(np.eye(3), np.array([-opening, 0.0, 0.0]))
    part = PartState(*DRAWER, np.asarray(opening), cavity, cavity, np.asarray(False))
    return SceneState(tcp_pose, np.asarray(0.0), {"box": box}, {"drawer": part})


def _rewards(goals, states) -> list[float]:
    return [float(progress(goals, state, TOLERANCE)) for state in states]


def test_a_pose_goal_rises_from_reaching_to_letting_go():
    states = [
        _state((0.2, 0, 0.05), (0.2, 0, 0.5)),
        _state((0.2, 0, 0.05), (0.2, 0, 0.2)),
        _state((0.2, 0, 0.05), (0.2, 0, 0.05), held=True),
        _state((0.35, 0, 0.1), (0.35, 0, 0.1), held=True, turn=1.0, speed=0.2),
        _state((0.45, 0, 0.1), (0.45, 0, 0.1), held=True, turn=0.5, speed=0.2),
        _state((0.5, 0, 0.05), (0.5, 0, 0.05), held=True, speed=0.01),
        _state((0.5, 0, 0.05), (0.5, 0, 0.15)),
    ]
    rewards = _rewards((GOAL,), states)
    assert (np.diff(rewards) > 0.02).all(), rewards
    assert rewards[-1] == pytest.approx(1.0)


def test_throwing_it_down_on_the_way_does_not_pay():
    held = _state((0.35, 0, 0.1), (0.35, 0, 0.1), held=True)
    dropped = _state((0.35, 0, 0.05), (0.35, 0, 0.1))
    assert _rewards((GOAL,), [held])[0] > _rewards((GOAL,), [dropped])[0] + 0.1


def test_storing_rises_through_opening_though_the_drawer_must_be_shut_in_the_end():
    far = (-0.6, 0.0, 0.0)
    states = [
        _state(far, (0, 0, 0.5)),
        _state(far, (0, 0, 0.0)),
        _state(far, (-0.1, 0, 0.0), opening=0.1),
        _state(far, (-0.2, 0, 0.0), opening=0.2),
        _state(far, far, opening=0.2, held=True),
        _state((-0.4, 0, 0.1), (-0.4, 0, 0.1), opening=0.2, held=True),
        _state((-0.2, 0, 0.0), (-0.2, 0, 0.0), opening=0.2, held=True),
        _state((-0.2, 0, 0.0), (-0.2, 0, 0.0), opening=0.2),
        _state((-0.1, 0, 0.0), (-0.1, 0, 0.1), opening=0.1),
        _state((0, 0, 0.0), (0, 0, 0.0), opening=0.0),
    ]
    rewards = _rewards(STORE, states)
    assert (np.diff(rewards) > 0.01).all(), rewards
    assert rewards[-1] > 0.99


def test_opening_and_shutting_mirror_each_other():
    states = [_state((0, 0, 0), (0, 0, 0), opening=o) for o in (0.0, 0.05, 0.1, 0.18)]
    assert (np.diff(_rewards((OpenGoal("drawer"),), states)) > 0.05).all()
    assert (np.diff(_rewards((ShutGoal("drawer"),), states)) < -0.05).all()
    assert _rewards((OpenGoal("drawer", 0.9),), states)[-1] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("fraction", [0.4, 0.9])
def test_a_part_shut_as_far_as_asked_has_all_its_reward(fraction):
    just, wide = (_state((0, 0, 0), (0, 0, 0), opening=o) for o in (0.2 * (1 - fraction), 0.2))
    shut = ShutGoal("drawer", fraction)
    assert shut.met(just, Tolerance()) and not shut.met(wide, Tolerance())
    progress = [float(shut.progress(state, Tolerance())) for state in (just, wide)]
    assert progress[0] == pytest.approx(1.0) and progress[1] < 0.4


def test_several_objects_count_side_by_side():
    here, there = _state((0.5, 0, 0.05), (0, 0, 0.5)), _state((0.2, 0, 0.05), (0, 0, 0.5))
    mixed = SceneState(
        here.tcp_pose,
        here.gripper,
        {"box": there.objects["box"], "other": here.objects["box"]},
    )
    goals = (GOAL, PoseGoal("other", GOAL.pose))
    assert 0.45 < _rewards(goals, [mixed])[0] < 0.7
    fallen = _state((0.5, 0, -0.7), (0, 0, 0.5))
    assert _rewards((OnTableGoal("box"), GOAL), [fallen])[0] < 0.01
    assert _rewards((OnTableGoal("box"), GOAL), [here])[0] == pytest.approx(1.0)


def test_random_states_stay_within_bounds_and_below_success():
    rng = np.random.default_rng(0)
    for _ in range(200):
        state = _state(
            rng.uniform(-1, 1, 3),
            rng.uniform(-1, 1, 3),
            turn=rng.uniform(0, 3),
            held=bool(rng.integers(2)),
            touched=bool(rng.integers(2)),
            speed=rng.exponential(0.05),
            opening=rng.uniform(0, 0.2),
        )
        for goals in ((GOAL,), STORE, (OpenGoal("drawer"),), (OnTableGoal("box"), GOAL)):
            assert 0.0 <= float(progress(goals, state, TOLERANCE)) <= 1.0


def test_numpy_and_jax_agree_on_batches():
    import jax

    states = [_state((0.2, 0, 0.05), (0.2, 0, z), opening=z / 4) for z in (0.5, 0.2)]
    leaves = [
        {"pose": s.objects["box"].label_pose, "tcp": s.tcp_pose, "opening": s.parts["drawer"].opening}
        for s in states
    ]  # fmt: skip
    batch = jax.tree.map(lambda *x: jax.numpy.asarray(np.stack(x), float), *leaves)
    no = jax.numpy.zeros(2, bool)
    box = ObjectState(*BOX, batch["pose"], jax.numpy.zeros(2), jax.numpy.zeros(2), no, no)
    cavity = jax.numpy.asarray(np.stack([s.parts["drawer"].cavity_pose for s in states]))
    part = PartState(*DRAWER, batch["opening"], cavity, cavity, no)
    state = SceneState(batch["tcp"], jax.numpy.zeros(2), {"box": box}, {"drawer": part})
    for goals in ((GOAL,), STORE):
        both = np.asarray(progress(goals, state, TOLERANCE))
        np.testing.assert_allclose(both, _rewards(goals, states), atol=1e-5)


@pytest.mark.full
def test_it_rises_along_a_success_of_the_baseline():
    environment = load("single_object", "target_pose", 1, obs_mode="state", reward_mode="dense")
    environment.reset()
    rewards = [environment.step(action).reward for action in Baseline(environment).actions(1)]
    assert environment.task.success_now and rewards[-1] == 1.0
    assert max(rewards[:300]) < 1.0 and min(rewards) >= 0.0
    assert spearmanr(np.arange(len(rewards)), rewards).statistic > 0.9


def test_unknown_reward_modes_are_refused():
    with pytest.raises(InputError, match="unknown reward mode 'dens'; did you mean dense"):
        suite.load("single_object", "target_pose", reward_mode="dens")  # pyright: ignore
