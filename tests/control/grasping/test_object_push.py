"""A loose object is pushed over the table with closed fingers; what is held is lowered as far as there is room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.execution.executor import Executor
from manipose_mj.control.execution.primitives import Primitives
from manipose_mj.control.grasping.object_push import push_object
from manipose_mj.control.grasping.retraction import lowering
from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan import Step
from manipose_mj.control.planning.set_aside import places_pushed
from manipose_mj.control.scene.collision_query import CONTACT
from manipose_mj.failures import StageFailure
from manipose_mj.tasks.core.config import EpisodeSpec


@pytest.fixture(scope="module")
def environment():
    """One steel tape on the table."""
    environment = suite.load(
        "single_object", "target_pose", seed=0, obs_mode="state", objects=["steel_tape_000"]
    )
    environment.reset()
    return environment, Baseline(environment)


def _planner(environment, baseline) -> MotionPlanner:
    task, scene = environment.task, baseline.perception.observe().scene
    arm = ArmModel(task.root_entity.mjcf_model, task.robot.mjcf_model.model)
    return MotionPlanner(scene, arm, task.control_timestep, np.random.default_rng(0))


def _reset(environment, baseline):
    environment.reset(EpisodeSpec(0))
    baseline.perception.reset(0)
    return baseline.perception.observe()


def test_a_push_moves_the_object_to_where_it_shall_go(environment):
    environment, baseline = environment
    estimate = _reset(environment, baseline)
    planner = _planner(environment, baseline)
    obj = estimate.objects["object"]
    poses = places_pushed(obj, (), estimate, planner)
    assert poses
    for pose in poses:
        assert np.allclose(pose[:3, :3], obj.label_pose[:3, :3])
        assert 0.05 < np.linalg.norm(pose[:2, 3] - obj.label_pose[:2, 3]) < 0.11
    executor = Executor(baseline.perception, environment.task.control_timestep)
    for action in Primitives(executor).move_to(planner, Step("move_to", "object", poses=poses)):
        environment.step(action)
    moved = executor.observe().objects["object"].label_pose
    shift = moved[:2, 3] - obj.label_pose[:2, 3]
    ends = [np.linalg.norm(moved[:2, 3] - pose[:2, 3]) for pose in poses]
    assert np.linalg.norm(shift) > 0.04 and min(ends) < 0.03
    assert abs(moved[2, 3] - obj.label_pose[2, 3]) < 0.005  # it still lies on the table


def test_what_the_hand_cannot_get_beside_is_not_pushed(environment):
    environment, baseline = environment
    estimate = _reset(environment, baseline)
    planner = _planner(environment, baseline)
    obj = estimate.objects["object"]
    assert push_object(planner, estimate, obj, ()) is None
    away = replace(obj, pose=obj.pose.copy())
    away.pose[0, 3] += 3.0  # out of reach
    nearer = away.label_pose.copy()
    nearer[0, 3] -= 0.1
    assert push_object(planner, estimate, away, (nearer,)) is None
    primitives = Primitives(Executor(baseline.perception, 0.02))
    with pytest.raises(StageFailure, match="no way to push object"):
        list(primitives.move_to(planner, Step("move_to", "object", poses=())))


def test_what_is_held_is_lowered_until_it_nearly_meets_the_table(environment, tcp_at):
    environment, baseline = environment
    estimate = _reset(environment, baseline)
    planner = _planner(environment, baseline)
    obj = estimate.objects["object"]
    joints = tcp_at([0.5, 0.0, 0.15])
    in_hand = obj.label_pose.copy()
    in_hand[:3, 3] = 0.5, 0.0, 0.12
    attached = obj.placed_at(in_hand)
    pose = planner.tcp_pose(joints)
    held = obj.attached_to(pose)
    held = type(held)(held.body, held.geoms, np.linalg.inv(pose) @ attached.place, 0.03)
    line = lowering(planner, joints, held)
    assert line is not None
    fallen = pose[2, 3] - planner.tcp_pose(line[-1])[2, 3]
    assert fallen > 0.03
    further = pose.copy()
    further[2, 3] -= fallen + 0.02
    assert planner.line(joints, further, held.query(CONTACT), off_support=False) is None
