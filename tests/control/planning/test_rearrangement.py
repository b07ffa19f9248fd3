"""Plans in clutter: what lies on a target goes first, aside, to free places; then the target."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.control.planning import rearrangement
from manipose_mj.control.planning.obstructions import blockers_of
from manipose_mj.control.planning.planner import make_plan
from manipose_mj.control.planning.rearrangement import candidate_moves, in_clutter, is_supported
from manipose_mj.control.planning.set_aside import places_aside, radius
from manipose_mj.control.planning.table_places import is_free
from manipose_mj.errors import InputError
from manipose_mj.evaluation import episode
from manipose_mj.poses import compose, invert, rotation_about
from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.goals import PoseGoal, Tolerance
from tests.few_objects import config, load

SEED = 1


@pytest.fixture(scope="module")
def stacked():
    """Environment, perception and planner of one stack."""
    environment = load("clutter", "stacked", seed=SEED, obs_mode="state")
    environment.random_state.seed(SEED)
    environment.reset()
    task = environment.task
    arm = ArmModel(task.root_entity.mjcf_model, task.robot.mjcf_model.model)
    perception = OraclePerception(task, environment.physics)
    scene = perception.observe().scene
    return environment, perception, MotionPlanner(scene, arm, 0.02, np.random.default_rng(0))


def _target_goal(task) -> PoseGoal:
    return next(goal for goal in task.goals if isinstance(goal, PoseGoal))


def test_what_lies_on_the_target_goes_first_and_aside(stacked):
    environment, perception, planner = stacked
    task, estimate = environment.task, perception.observe()
    assert in_clutter(task.goals, estimate)
    grasp, move, release = next(candidate_moves(task.goals, estimate, planner)).steps()
    assert [s.primitive for s in (grasp, move, release)] == ["grasp_at", "move_to", "release"]
    assert grasp.subject == move.subject == release.subject != "object"
    goal, mover = _target_goal(task), estimate.objects[grasp.subject]
    for pose in move.poses:
        assert is_free(planner, mover, pose)
        assert pose[2, 3] > 0 and np.linalg.norm(pose[:2, 3] - goal.pose[:2, 3]) > 0.05


@pytest.mark.full
def test_other_moves_are_tried_before_it_gives_up(stacked):
    environment, perception, planner = stacked
    estimate = perception.observe()
    candidates = candidate_moves(environment.task.goals, estimate, planner)
    seen = []
    with pytest.raises(InputError, match="nothing can be moved any more"):
        for move in candidates:
            seen.append((move.steps()[0].subject, move.contact_allowance))
    subjects = [subject for subject, _ in seen]
    assert len(set(subjects)) > 2 and "object" in subjects[1:]
    assert {allowance for _, allowance in seen} == {0.001, 0.006, 0.012}
    assert len(seen) <= 3 * (len(estimate.objects) + 5)


def test_what_blocks_a_target_is_what_lies_on_it_and_without_that_it_is_free(stacked):
    _, perception, planner = stacked
    estimate = perception.observe()
    target = estimate.objects["object"]
    sets = blockers_of(target, estimate, planner.allowing(0.001))
    assert sets and all(sets)
    far = compose(np.eye(3), np.array([0.0, 0.0, 3.0]))
    scene = estimate.scene
    for name in sets[0]:
        obj = estimate.objects[name]
        scene = scene.with_body_at(obj.body, far @ obj.pose)
    emptied = replace(estimate, scene=scene)
    assert frozenset() in blockers_of(target, emptied, planner.within(scene).allowing(0.001))


def test_places_aside_keep_off_goals_also_where_the_table_is_full(stacked):
    environment, perception, planner = stacked
    estimate = perception.observe()
    goal = _target_goal(environment.task)
    for name, obj in estimate.objects.items():
        poses = places_aside(obj, [goal], estimate, planner)
        assert poses and name
        for pose in poses:
            assert is_free(planner, obj, pose)
            size = radius(obj) + radius(estimate.objects[goal.object])
            assert np.linalg.norm(pose[:2, 3] - goal.pose[:2, 3]) > size - 0.021


def test_the_stack_supports_its_top_and_thin_air_does_not(stacked):
    _, perception, planner = stacked
    estimate = perception.observe()
    assert all(is_supported(obj, estimate.scene) for obj in estimate.objects.values())
    target = estimate.objects["object"]
    raised = compose(np.eye(3), np.array([0.0, 0.0, 0.5])) @ target.pose
    assert not is_supported(target, estimate.scene.with_body_at(target.body, raised))


def test_nothing_is_left_to_do_once_the_target_is_there(stacked):
    environment, perception, planner = stacked
    task, goal = environment.task, _target_goal(environment.task)
    obj = task.objects["object"]
    before = obj.object_pose(environment.physics)
    obj.place(environment.physics, goal.pose @ invert(obj.asset.label.pose))
    moves = list(candidate_moves(task.goals, perception.observe(), planner))
    assert [move.steps() for move in moves] == [()]
    obj.place(environment.physics, before)
    environment.physics.forward()


@pytest.mark.parametrize(
    ("shift", "degrees", "tolerance", "done"),
    [
        (0.0179, 12.9, Tolerance(), True),
        (0.0181, 0.0, Tolerance(), False),
        (0.0, 13.1, Tolerance(), False),
        (0.044, 0.0, Tolerance(translation=0.05), True),
        (0.046, 0.0, Tolerance(translation=0.05), False),
        (0.01, 0.0, Tolerance(translation=0.005), False),
        (0.0, 25.0, Tolerance(rotation=np.radians(30)), True),
        (0.0, 4.5, Tolerance(rotation=np.radians(5)), False),
    ],
)
def test_what_is_left_alone_meets_the_tolerance_of_the_task(
    stacked, shift, degrees, tolerance, done
):
    environment, perception, planner = stacked
    estimate, goal = perception.observe(), _target_goal(environment.task)
    obj = estimate.objects["object"]
    tilt = rotation_about(obj.label_pose[:3, 0], np.radians(degrees))
    tilt = compose(tilt @ goal.pose[:3, :3], goal.pose[:3, 3] + [shift, 0.0, 0.0])
    lying = replace(obj, pose=tilt @ invert(obj.label.pose))
    there = replace(estimate, objects={**estimate.objects, "object": lying})
    plan = make_plan(environment.task.goals, there, planner, tolerance)
    assert (plan == ()) is done


def test_by_default_2_mm_and_2_deg_are_to_spare_to_the_bit():
    shares, usual = rearrangement._MET, Tolerance()
    assert shares[0] * usual.translation == 0.018
    assert shares[1] * usual.rotation == np.radians(13)


def test_a_motion_that_does_not_touch_the_pile_ignores_its_own_contacts(stacked):
    _, perception, planner = stacked
    estimate = perception.observe()
    assert estimate.scene.first_collision(estimate.joints) is None
    touching = estimate.scene.touching(estimate.objects["object"].geoms, 0.002)
    assert any(upwards > 0.3 for _, upwards in touching)


@pytest.mark.full
@pytest.mark.parametrize(("task", "seed"), [("pick", 2), ("multi", 3), ("stacked", 24)])
def test_the_baseline_succeeds(task, seed):
    result, _ = episode.run_episode(config(f"clutter/{task}", obs_mode="state"), EpisodeSpec(seed))
    assert result.success_at_end, result.reason
    assert result.max_penetration < 0.005
