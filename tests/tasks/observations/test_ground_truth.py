"""What each observation tells truly, and that no observation of a task is left out."""

from __future__ import annotations

import pytest

from manipose_mj import suite
from manipose_mj.tasks.observations.ground_truth import GroundTruth, told_by, told_by_all
from manipose_mj.tasks.observations.sensors import MODES, SensorConfig
from tests.few_objects import few

NOTHING, POSES, MASKS = GroundTruth(), GroundTruth(poses=True), GroundTruth(masks=True)


@pytest.mark.parametrize(
    ("obs_mode", "told"),
    [
        ("state", NOTHING),
        ("state+rgb+depth", NOTHING),
        ("panda/joint_positions+depth/front+camera/front/pose", NOTHING),
        ("state+pose", POSES),
        ("pose/object", POSES),
        ("pose/robot/handle", POSES),
        ("pose/opening_middle", POSES),
        ("pose/symmetry/object+pose/counts/goal", NOTHING),
        ("state+segmentation", MASKS),
        ("segmentation/front", MASKS),
        ("state+pointcloud", MASKS),
        ("pointcloud/points", NOTHING),
        ("pointcloud/points+pointcloud/colours", NOTHING),
        ("pointcloud/instance", MASKS),
        ("pointcloud/normals", MASKS),
        ("pointcloud/object/points", MASKS),
        ("pointcloud/points+pose/goal", POSES),
        ("pose+pointcloud", GroundTruth(poses=True, masks=True)),
    ],
)
def test_a_mode_or_key_tells_poses_masks_or_nothing(obs_mode, told):
    assert told_by_all(obs_mode) == told


def test_keys_of_a_mode_tell_no_more_than_the_mode_and_together_all_of_it():
    env = suite.load(
        "single_object",
        "target_pose",
        obs_mode="+".join(MODES),
        sensors=SensorConfig(
            cameras=("front",), height=12, width=16, cloud_size=16, renderer="ray"
        ),
        objects=few("single_object/target_pose"),
    )
    told = {mode: [] for mode in MODES}
    for key in env.observation_spec():
        mode = key.split("/")[0]
        told.get(mode, told["state"]).append(told_by(key))  # the robot's, and calibration
    for mode, keys in told.items():
        whole = told_by(mode)
        assert whole.poses == any(each.poses for each in keys), mode
        assert whole.masks == any(each.masks for each in keys), mode
