"""What lies on its rim is set down over the table's edge: plates upside down, wide bowls."""

from __future__ import annotations

from unittest.mock import Mock

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset
from manipose_mj.control.planning.table_places import poses_at_edge
from manipose_mj.control.planning.transport import transport_plans
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.evaluation.episode import run_episode
from manipose_mj.mjcf.arena import TABLE_CENTER, TABLE_HALF_EXTENTS
from manipose_mj.poses import compose
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.goals import OrientationGoal
from manipose_mj.tasks.scene.overhang import edge_pairs, from_below, poses_over_edge
from manipose_mj.tasks.scene.resting import label_ups, pose_on_table, usable_poses
from manipose_mj.tasks.single_object.orientation import orientation_pairs

EDGE = TABLE_CENTER[0] - TABLE_HALF_EXTENTS[0]
PLACE = np.array([0.48, 0.1])


@pytest.fixture(scope="module")
def plate() -> Asset:
    return catalogue.load("plate", 4)


def _lying(asset: Asset, stable: int) -> ObjectEstimate:
    grasps = asset.grasps
    assert grasps is not None
    pose = pose_on_table(asset, stable, PLACE, 0.3)
    geoms = np.zeros(1, bool)
    return ObjectEstimate(
        "object", pose, asset.label, lambda: grasps, 1, geoms, rests=asset.stable_poses
    )


def _turned(asset: Asset, stable: int) -> np.ndarray:
    return (pose_on_table(asset, stable, PLACE, 0.3) @ asset.label.pose)[:3, :3]


def test_plates_are_turned_upside_down_and_not_back(plate: Asset) -> None:
    """Upside down their rim leaves no room on the table; other objects keep their pairs."""
    ups = label_ups(plate)[:, 0]
    assert usable_poses(plate) == [0] and ups[0] > 0.99 and ups[1] < -0.99
    assert orientation_pairs(plate, 0.5) == edge_pairs(plate) == [(0, 1)]
    mug = catalogue.load("mug", 0)
    assert all(goal in usable_poses(mug) for _, goal in orientation_pairs(mug, 0.5))


def test_the_middle_stays_on_the_table_and_the_rim_beyond_it(plate: Asset) -> None:
    for pose in poses_over_edge(plate.label, _turned(plate, 1)).reshape(-1, 4, 4):
        reach = plate.label.reach(pose[:3, :3])
        assert EDGE < pose[0, 3] < EDGE + reach[0] and pose[0, 3] - reach[0] < EDGE
        assert pose[2, 3] == pytest.approx(reach[2])


def test_only_what_no_grasp_can_set_down_goes_over_the_edge(plate: Asset) -> None:
    lying, mug = _lying(plate, 0), _lying(catalogue.load("mug", 0), 0)
    groups = poses_at_edge(lying, _turned(plate, 1))
    assert groups and all(len(group) for group in groups)
    assert not poses_at_edge(lying, _turned(plate, 0))
    assert not poses_at_edge(mug, mug.label_pose[:3, :3])
    without_motions = SceneEstimate(
        np.zeros(7), 0.08, {"object": lying}, {}, Mock(spec=PlanningScene)
    )
    goal = OrientationGoal("object", _turned(plate, 1))
    assert len(list(transport_plans(goal, without_motions))) == 1  # nothing is tried there


def test_a_hand_from_below_points_up_beyond_the_edge() -> None:
    up, beyond = np.eye(3), np.array([EDGE - 0.03, 0.4, 0.03])
    assert from_below(compose(up, beyond))
    assert not from_below(compose(up, beyond + [0.1, 0.0, 0.0]))
    assert not from_below(compose(np.diag([1.0, -1.0, -1.0]), beyond))


@pytest.mark.full
def test_a_plate_is_turned_upside_down(plate: Asset) -> None:
    task = "single_object/orientation"
    config = EnvConfig(task, obs_mode="state", objects=(str(plate.folder),))
    result, _ = run_episode(config, EpisodeSpec(0))
    assert result.success_at_end, result.reason
