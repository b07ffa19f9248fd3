"""Plans in clutter: what lies on a target goes first, aside, to free places; then the target."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.control import episode
from manipose_mj.control.arm_model import ArmModel
from manipose_mj.control.clearing import in_clutter, is_supported, next_move
from manipose_mj.control.motion_planner import MotionPlanner
from manipose_mj.control.oracle import OracleSenses
from manipose_mj.control.planning_scene import PlanningScene
from manipose_mj.control.table_places import is_free
from manipose_mj.errors import InputError
from manipose_mj.poses import invert
from manipose_mj.tasks.goals import PoseGoal

SEED = 1


@pytest.fixture(scope="module")
def stacked():
    """Environment, senses and planner of one stack."""
    environment = suite.load("clutter", "stacked", seed=SEED, observations="state")
    environment.random_state.seed(SEED)
    environment.reset()
    task, model = environment.task, environment.physics.model.ptr
    robot = task.robot.mjcf_model.model
    scene = PlanningScene(model, model.body(f"{robot}/").id, model.body(f"{robot}/hand").id)
    arm = ArmModel(task.root_entity.mjcf_model, robot)
    senses = OracleSenses(task, environment.physics, scene)
    return environment, senses, MotionPlanner(scene, arm, 0.02, np.random.default_rng(0))


def _target_goal(task) -> PoseGoal:
    return next(goal for goal in task.goals if isinstance(goal, PoseGoal))


def test_what_lies_on_the_target_goes_first_and_aside(stacked):
    environment, senses, planner = stacked
    task, belief = environment.task, senses.look()
    assert in_clutter(task.goals, belief)
    grasp, move, release = next_move(task.goals, belief, planner)
    assert [s.primitive for s in (grasp, move, release)] == ["grasp_at", "move_to", "release"]
    assert grasp.subject == move.subject == release.subject != "object"
    goal, mover = _target_goal(task), belief.objects[grasp.subject]
    for pose in move.poses:
        assert is_free(planner, mover, pose)
        assert pose[2, 3] > 0 and np.linalg.norm(pose[:2, 3] - goal.pose[:2, 3]) > 0.05


def test_other_moves_are_tried_before_it_gives_up(stacked):
    environment, senses, planner = stacked
    belief = senses.look()
    subjects = [
        next_move(environment.task.goals, belief, planner, skip)[0].subject for skip in range(2)
    ]
    assert subjects[0] != subjects[1]
    with pytest.raises(InputError, match="none of .* can be moved"):
        next_move(environment.task.goals, belief, planner, 1000)


def test_the_stack_supports_its_top_and_thin_air_does_not(stacked):
    _, senses, planner = stacked
    belief = senses.look()
    assert all(is_supported(thing, planner) for thing in belief.objects.values())
    body = belief.objects["object"].body
    address = planner.scene.model.jnt_qposadr[planner.scene.model.body_jntadr[body]]
    planner.scene.data.qpos[address + 2] += 0.5
    assert not is_supported(belief.objects["object"], planner)
    senses.look()


def test_nothing_is_left_to_do_once_the_target_is_there(stacked):
    environment, senses, planner = stacked
    task, goal = environment.task, _target_goal(environment.task)
    thing = task.movable["object"]
    before = thing.object_pose(environment.physics)
    thing.place(environment.physics, goal.pose @ invert(thing.asset.label.pose))
    assert next_move(task.goals, senses.look(), planner) == ()
    thing.place(environment.physics, before)
    environment.physics.forward()


def test_a_motion_that_does_not_touch_the_pile_ignores_its_own_contacts(stacked):
    _, senses, planner = stacked
    belief = senses.look()
    assert planner.scene.first_collision(belief.joints) is None
    touching = planner.scene.touching(belief.objects["object"].geoms, 0.002)
    assert any(upwards > 0.3 for _, upwards in touching)


@pytest.mark.parametrize(("task", "seed"), [("pick", 2), ("multi", 3), ("stacked", 24)])
def test_the_baseline_succeeds(task, seed):
    result, _ = episode.run_episode(f"clutter/{task}", episode=0, seed=seed)
    assert result.success_at_end, result.reason
    assert result.max_penetration < 0.005
