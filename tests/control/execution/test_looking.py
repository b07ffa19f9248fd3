"""The hand's camera is brought before drawers and doors that stand open, and looks at the middle of what they hide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.execution.looking import way_to_look_into
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.perception.camera_rig import HAND_CAMERA
from manipose_mj.control.perception.pose_sources import sensors_for
from manipose_mj.control.scene.articulation import joint_motion, with_part_at
from manipose_mj.evaluation.protocol.frozen import load as load_protocol
from manipose_mj.mjcf.cameras.ray_camera import camera_pose
from manipose_mj.poses import invert, pose_error
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from tests.few_objects import load

WIDE_OPEN = 0.85  # of a part's range


@pytest.fixture(scope="module", params=["take_out_middle_drawer", "take_out_microwave"])
def opened(request):
    """An environment, a planner in its scene with the part open, the estimate, and the part."""
    environment = load("articulated", request.param, seed=0, obs_mode="state")
    environment.reset()
    baseline = Baseline(environment)
    estimate = baseline.perception.observe()
    part = estimate.parts[environment.task.part.name]
    low, high = part.joint.range
    opening = low + WIDE_OPEN * (high - low)
    scene = with_part_at(estimate.scene, part, opening)
    part = replace(part, opening=opening, pose=part.base_pose @ joint_motion(part, opening))
    planner = MotionPlanner(scene, baseline.arm, 0.02, np.random.default_rng(0))
    return environment, planner, replace(estimate, scene=scene), part


def test_the_camera_looks_into_what_is_open(opened):
    environment, planner, estimate, part = opened
    way = way_to_look_into(planner, estimate, part)
    assert way is not None
    np.testing.assert_allclose(way[0], estimate.joints, atol=0.05)
    physics, robot = environment.physics, environment.task.robot
    robot.set_configuration(physics, way[-1], 0.08)
    physics.forward()
    camera = camera_pose(physics.model.ptr, physics.data.ptr, "panda/wrist")
    frame = part.pose if part.cavity.moves_with_part else part.base_pose
    middle = (frame @ np.append(part.cavity.center, 1.0))[:3]
    seen = (invert(camera) @ np.append(middle, 1.0))[:3]
    np.testing.assert_allclose(seen[:2], 0.0, atol=2e-3)
    assert 0.39 < seen[2] < 0.61  # a depth camera's good distances
    # From outside, and from above.
    out = (part.base_pose @ part.handle.pose)[:3, 1]
    assert (camera[:3, 3] - middle) @ out > 0.05
    assert camera[2, 3] > middle[2] + 0.05


def test_where_there_is_no_room_it_does_not_look(opened):
    _, planner, estimate, part = opened
    far = part.base_pose.copy()
    far[:3, 3] += [3.0, 0.0, 0.0]
    assert way_to_look_into(planner, estimate, replace(part, base_pose=far, pose=far)) is None


@pytest.mark.full
def test_what_was_opened_is_looked_into_and_then_estimated_by_the_hand_s_camera_too():
    task = "articulated/take_out_microwave"
    environment = suite.make(
        EnvConfig(task, obs_mode="state", split="test", sensors=sensors_for("estimated"))
    )
    environment.reset(EpisodeSpec(**load_protocol("v1").episode(task, 1).asked))
    baseline = Baseline(environment, "estimated")
    looked = False
    for action in baseline.actions(0):
        environment.step(action)
        looking = baseline.status.startswith("look into")
        if looked and not looking:
            break
        looked |= looking
    assert looked
    estimates = {each.name: each for each in baseline.perception.last_estimates}
    assert HAND_CAMERA in estimates["object"].camera.split("+")
    label = environment.task.object.asset.label
    truth = environment.task.object.label_pose(environment.physics)
    shift, turn = pose_error(estimates["object"].pose, truth, label.symmetry)
    assert shift < 0.02
    assert turn < np.deg2rad(15)
