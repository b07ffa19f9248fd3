"""Whole episodes: the baseline succeeds, repeats bit for bit, holds firmly and says why it fails."""

from __future__ import annotations

from dataclasses import asdict
from functools import lru_cache
from itertools import islice

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.execution.executor import Executor
from manipose_mj.control.execution.lifting import retraction_of
from manipose_mj.control.execution.primitives import Primitives
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.planner import RulePlanner
from manipose_mj.errors import InputError
from manipose_mj.evaluation import episode
from manipose_mj.evaluation.records import EpisodeResult, Trajectory
from manipose_mj.failures import StageFailure
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.poses import compose, invert, rotation_angle
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.goals import PoseGoal
from manipose_mj.tasks.single_object.target_pose import TargetPose
from tests.few_objects import config, load
from tests.tasks.contact import touches_robot

TARGET_POSE = "single_object/target_pose"
STORE = "articulated/store_chips_can_middle_drawer"
SEEDS = {TARGET_POSE: (0, 1, 2), STORE: (1, 2, 3)}
HOLD = np.append(HOME, MAX_OPENING)


def _run(task: str, seed: int) -> tuple[EpisodeResult, Trajectory]:
    return episode.run_episode(config(task, obs_mode="state"), EpisodeSpec(seed))


@lru_cache
def played(task: str, seed: int) -> tuple[EpisodeResult, Trajectory]:
    """An episode, once for all tests."""
    return _run(task, seed)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("task", "seed"), [(t, seed) for t, seeds in SEEDS.items() for seed in seeds]
)
def test_the_baseline_succeeds_and_pushes_nothing_into_anything(task, seed):
    result, _ = played(task, seed)
    assert result.success_at_end and result.success_once, (result.failure, result.reason)
    assert result.failure is None and result.reason == ""
    assert (result.task, result.seed, result.pose_source) == (task, seed, "oracle")
    if task == TARGET_POSE:
        assert result.translation_error is not None and result.translation_error < 0.02
        assert result.rotation_error is not None and result.rotation_error < np.radians(15)
    assert result.max_penetration < 0.002


@pytest.mark.full
@pytest.mark.parametrize("task", SEEDS)
def test_an_episode_repeats_bit_for_bit_whatever_ran_before(task):
    seed, *others = SEEDS[task]
    first, trajectory = played(task, seed)
    for each in others:
        played(task, each)
    again, same = _run(task, seed)
    own, other = asdict(first), asdict(again)
    for name in ("wall_s", "policy_s"):
        assert own.pop(name) > 0 and other.pop(name) > 0
    assert own == other
    np.testing.assert_array_equal(trajectory.times, same.times)
    for one, two in zip(vars(trajectory).values(), vars(same).values(), strict=True):
        np.testing.assert_array_equal(one, two)


@pytest.mark.full
def test_a_door_that_no_single_push_shuts_is_pushed_twice():
    """The door stands open by 102 deg beside the robot, where its handle cannot be approached."""
    spec = EpisodeSpec(1816007807, furniture="microwave_004", part="door")
    result, trajectory = episode.run_episode(
        EnvConfig("articulated/close_microwave", obs_mode="state", split="test"), spec
    )
    assert result.success_at_end, result
    assert trajectory.qpos[0, -1] > 1.7


def test_the_record_follows_the_episode():
    result, trajectory = played(TARGET_POSE, 0)
    arrays = [v for v in vars(trajectory).values() if isinstance(v, np.ndarray)]
    times, positions = arrays
    assert result.sim_time == pytest.approx(result.steps * 0.02)
    assert times[0] == 0 and times[-1] == pytest.approx(result.sim_time, abs=1e-6)
    assert (np.diff(times) >= 0).all() and len(positions) == len(times)
    start = config(TARGET_POSE, obs_mode="state"), EpisodeSpec(0)
    model = episode.scene_model(*start)
    assert positions.shape[1] == model.nq
    _, data = episode.start_state(*start)
    np.testing.assert_allclose(positions[0], data.qpos, atol=1e-6)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["chips_can_000", "box_000"])
def test_a_held_object_does_not_slip(name):
    environment = load(
        "single_object",
        "target_pose",
        seed=0,
        obs_mode="state",
        objects=[catalogue.load_by_name(name)],
        environment_kwargs={"time_limit": 60.0},
    )
    environment.reset()
    baseline, task, physics = Baseline(environment), environment.task, environment.physics
    executor = Executor(baseline.perception, task.control_timestep)
    rng = np.random.default_rng(0)
    scene = executor.observe().scene
    planner = MotionPlanner(scene, baseline.arm, task.control_timestep, rng)
    primitives = Primitives(executor)

    def play(actions) -> None:
        for action in actions:
            environment.step(action)

    def in_hand() -> np.ndarray:
        return invert(task.robot.tcp_pose(physics)) @ task.object.object_pose(physics)

    play(primitives.grasp_at(planner, "object", None))
    before = task.object.object_pose(physics)[2, 3]
    estimate = executor.observe()
    play(executor.follow(retraction_of(planner.within(estimate.scene), estimate, "object")))
    play(executor.wait(0.5))
    start = in_hand()
    assert task.object.object_pose(physics)[2, 3] > before + 0.025
    assert touches_robot(task, physics, task.object)
    play(executor.wait(5.0))
    slipped = in_hand()
    assert np.linalg.norm(slipped[:3, 3] - start[:3, 3]) < 1e-3
    assert rotation_angle(slipped[:3, :3], start[:3, :3]) < np.radians(1)
    assert not task.succeeded(physics)


def _fail(monkeypatch, actions, task: str = TARGET_POSE) -> EpisodeResult:
    monkeypatch.setattr(Baseline, "actions", actions)
    result, trajectory = _run(task, 0)
    assert not result.success_at_end
    assert "\n" not in result.reason and result.reason
    assert len(trajectory.times) >= 2
    return result


@pytest.mark.sample(1)
@pytest.mark.parametrize("away", [(2.0, 0.0, 0.1), (0.5, 0.0, -0.3)], ids=["far", "in the table"])
def test_a_goal_out_of_reach_fails_in_planning(monkeypatch, away):
    goal = PoseGoal("object", compose(np.eye(3), np.array(away)))
    monkeypatch.setattr(TargetPose, "goals", property(lambda self: (goal,)))
    result, _ = _run(TARGET_POSE, 0)
    assert (result.failure, result.success_at_end, result.success_once) == ("plan", False, False)
    assert "object" in result.reason


def test_giving_up_is_recorded_with_its_stage(monkeypatch):
    def give_up(*_):
        yield HOLD
        yield HOLD
        raise StageFailure("grasp", "the gripper closed past object")

    result = _fail(monkeypatch, give_up)
    assert (result.failure, result.reason) == ("grasp", "the gripper closed past object")
    assert result.steps == 2


def test_stopping_short_of_the_goal_is_a_failure(monkeypatch):
    assert _fail(monkeypatch, lambda *_: iter([HOLD] * 5)).failure == "release"


def test_running_out_of_time_is_recorded(monkeypatch):
    environment = episode.environment_of(config(TARGET_POSE, obs_mode="state"))
    monkeypatch.setattr(environment, "_time_limit", 0.1)
    result = _fail(monkeypatch, lambda *_: iter([HOLD] * 100))
    assert (result.failure, result.steps) == ("timeout", 5)


def test_a_diverging_simulation_is_recorded_and_harms_no_later_episode(monkeypatch):
    before, _ = played(TARGET_POSE, 0)

    def diverge(self, *_):
        yield HOLD
        self._environment.physics.data.qvel[:] = np.nan
        yield HOLD

    with monkeypatch.context() as patched:
        result = _fail(patched, diverge)
    assert result.failure == "physics"
    again, _ = _run(TARGET_POSE, 0)
    times = {"wall_s": 0.0, "policy_s": 0.0}
    assert {**asdict(again), **times} == {**asdict(before), **times}


def test_an_unknown_stage_cannot_be_raised():
    with pytest.raises(AssertionError):
        StageFailure("luck", "none left")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"task": "single_object/target_pse"}, "did you mean single_object/target_pose"),
        ({"task": "target_pose"}, "unknown task"),
        ({"pose": "orcale"}, "oracle"),
        ({"objects": "chips_cam_000"}, "chips_can_000"),
        ({"objects": "./nowhere"}, "no such folder"),
        (
            {"spec": EpisodeSpec(0, object="box_099")},
            "unknown object 'box_099'; did you mean box_0",
        ),
    ],
)
def test_names_that_do_not_exist_are_refused(arguments, message):
    spec, pose = arguments.pop("spec", EpisodeSpec(0)), arguments.pop("pose", "oracle")
    with pytest.raises(InputError, match=message):
        episode.run_episode(EnvConfig(**{"task": TARGET_POSE, **arguments}), spec, pose=pose)


class _FewPlans(RulePlanner):
    """Has only the first plans that rules make, one move at a time."""

    def __init__(self, count):
        self.count = count

    def step_by_step(self, goals, estimate):
        return True

    def candidates(self, goals, estimate, planner, tolerance):
        return islice(super().candidates(goals, estimate, planner, tolerance), self.count)


@pytest.mark.parametrize("count", [0, 1])
def test_a_planner_without_another_plan_is_a_failure_of_planning(count, monkeypatch):
    def blocked(self, *arguments, **more):
        raise StageFailure("motion", "blocked")
        yield

    environment = load(*TARGET_POSE.split("/"), seed=0, obs_mode="state")
    environment.reset()
    monkeypatch.setattr(Baseline, "_carry_out", blocked)
    with pytest.raises(StageFailure, match="no plan left") as caught:
        next(Baseline(environment, planner=_FewPlans(count)).actions(0))
    assert caught.value.stage == "plan"
