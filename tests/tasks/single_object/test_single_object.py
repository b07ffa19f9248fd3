"""The tasks about one object: where they start, what counts as done, what they refuse."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest
from dm_control import composer

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset, GraspSet, StablePose
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.mjcf.shelf import ShelfConfig
from manipose_mj.mjcf.sleep import sleep_disabled
from manipose_mj.poses import compose, invert, pose_error, rotation_about, transform
from manipose_mj.tasks.goals import OrientationGoal
from manipose_mj.tasks.scene.resting import (
    label_ups,
    placements_between,
    pose_on_table,
    require_graspable,
    usable_poses,
)
from manipose_mj.tasks.single_object.grasp_room import above_floor, grasps_with_room
from manipose_mj.tasks.single_object.orientation import orientation_pairs
from manipose_mj.tasks.single_object.position import IntoShelfConfig, PositionConfig
from manipose_mj.tasks.single_object.reorient import tipped_poses
from manipose_mj.tasks.single_object.shelf_places import ShelfPlaces
from manipose_mj.tasks.single_object.shelf_sampler import ShelfSampler
from manipose_mj.tasks.single_object.target_pose import TargetPose, TargetPoseConfig
from tests.few_objects import config, load

HOLD = np.append(HOME, MAX_OPENING)
UP = np.array([0.0, 0.0, 1.0])
PLACES = ShelfPlaces()


@pytest.fixture(scope="module")
def mug() -> Asset:
    return catalogue.load("mug", 0)


def _environment(task: str, **arguments) -> composer.Environment:
    return load("single_object", task, seed=0, obs_mode="state", **arguments)


@pytest.fixture(scope="module")
def orientation() -> composer.Environment:
    return _environment("orientation")


@pytest.fixture(scope="module")
def reorient() -> composer.Environment:
    return _environment("reorient_mug")


@pytest.fixture(scope="module")
def position() -> composer.Environment:
    return _environment("position")


def _reset(environment: composer.Environment, seed: int):
    environment.random_state.seed(seed)
    environment.reset()
    return environment.task


def _draws(environment: composer.Environment, count: int):
    """Starts and goals of many episodes, without settling."""
    task, physics = environment.task, environment.physics
    for seed in range(count):
        task.start = start = task.draw(np.random.RandomState(seed))
        task.robot.set_configuration(physics, HOME, MAX_OPENING)
        with sleep_disabled(physics):
            task.scene.write(physics, start)
            physics.forward()
        yield task, physics


# Resting


def _asset_with(clear: list[list[int]], asset: Asset) -> Asset:
    count = len(clear[0])
    grasps = GraspSet(np.tile(np.eye(4), (len(clear), 1, 1)), np.full(len(clear), 0.05), np.array(clear, bool))  # fmt: skip
    return replace(asset, grasps=grasps, stable_poses=asset.stable_poses[:count])


def test_placements_are_counted_along_poses_that_share_grasps(mug):
    # Five grasps each join 0-1, 1-2 and 2-3; nothing joins 4.
    rows = [[1, 1, 0, 0, 0]] * 5 + [[0, 1, 1, 0, 0]] * 5 + [[0, 0, 1, 1, 0]] * 5
    needed = placements_between(_asset_with(rows, mug))
    assert needed[0].tolist() == [0, 0, 1, 2, -1]
    assert needed[3].tolist() == [2, 1, 0, 0, -1]
    assert needed[4, :4].tolist() == [-1] * 4
    few = placements_between(_asset_with(rows[:9], mug))  # four grasps are too few
    assert few[0, 1] == 0 and few[1, 2] == -1


def test_poses_of_real_use_are_the_common_and_the_upright_ones(mug):
    usable = usable_poses(mug)
    ups = label_ups(mug)[usable, 0]
    assert ups.max() > 0.99 and ups.min() < -0.99 and (np.abs(ups) < 0.1).sum() >= 4
    rare = [replace(p, probability=0.001) for p in mug.stable_poses]
    kept = usable_poses(replace(mug, stable_poses=tuple(rare)))
    assert all(abs(label_ups(mug)[i, 0]) > 0.98 for i in kept) and len(kept) == 2


def test_what_the_gripper_cannot_hold_is_refused_by_name_and_width(mug):
    require_graspable(mug)
    count = len(mug.stable_poses)
    nothing = GraspSet(np.empty((0, 4, 4)), np.empty(0), np.empty((0, count), bool), tried=0)
    label = replace(mug.label, extents=np.array([0.3, 0.12, 0.2]))
    wide = replace(mug, grasps=nothing, label=label)
    with pytest.raises(
        InputError, match="mug_000: .*120 mm wide at its narrowest.*80 mm"
    ) as caught:
        require_graspable(wide)
    assert "\n" not in str(caught.value)
    for task in ("target_pose", "orientation", "reorient_mug", "position", "target_pose_shelf"):
        with pytest.raises(InputError, match="^mug_000: too large for the gripper"):
            _environment(task, objects=[wide])
    with pytest.raises(InputError, match="no grasp"):
        require_graspable(replace(wide, label=replace(label, extents=np.full(3, 0.05))))


# Orientation


def test_some_orientations_need_placements_and_none_more_than_two(orientation):
    task = orientation.task
    needed = {}
    for asset, pairs in zip(task.assets, task._pairs, strict=True):
        counts = placements_between(asset)
        needed.setdefault(asset.category, []).extend(int(counts[pair]) for pair in pairs)
        assert all(start != goal for start, goal in pairs)
    assert min(min(counts) for counts in needed.values()) == 0
    assert {0, 1, 2} == set(needed["mug"])


def test_orientation_goals_differ_from_the_start_and_lie_in_no_place(orientation):
    for task, physics in _draws(orientation, 40):
        goal = task.goals[0]
        assert isinstance(goal, OrientationGoal)
        assert goal.error(task.scene_state(physics)) > task.task_config.min_turn
        np.testing.assert_allclose(goal.rotation @ goal.rotation.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_the_object_turned_to_its_goal_is_a_success_anywhere(orientation, seed):
    task = _reset(orientation, seed)
    physics, asset, goal = orientation.physics, task.object.asset, task.goals[0]
    assert not task.succeeded(physics)
    requested = compose(goal.rotation, np.zeros(3))
    best = min(
        (
            pose_on_table(asset, stable, np.array([0.5, 0.2]), yaw)
            for stable in usable_poses(asset)
            for yaw in np.linspace(-np.pi, np.pi, 73)
        ),
        key=lambda pose: pose_error(pose @ asset.label.pose, requested, asset.label.symmetry)[1],
    )
    task.object.place(physics, best)
    for _ in range(15):
        step = orientation.step(HOLD)
    assert step.reward == 1.0
    standing = abs(best[2, :3] @ asset.label.rotation[:, 0]) > 0.99 and asset.label.symmetry.axial
    turned = compose(rotation_about(UP, 1.0), best[:3, 3] - rotation_about(UP, 1.0) @ best[:3, 3])
    task.object.place(physics, turned @ best)
    assert orientation.step(HOLD).reward == float(standing)


def test_objects_that_cannot_be_turned_are_refused():
    scissor = catalogue.load("scissor", 4)
    with pytest.raises(InputError, match="scissor_004: has no stable pose that the gripper can"):
        orientation_pairs(scissor, radians(30))


def test_what_lies_on_one_side_only_is_turned_about_the_vertical():
    marker = catalogue.load("marker", 0)
    pairs = orientation_pairs(marker, radians(30))
    assert pairs and all(start == goal for start, goal in pairs)
    task = _environment("orientation", objects=[marker]).task
    assert task._pairs == [pairs]


# Upright


def test_mugs_start_upside_down_or_lying(reorient):
    ups = []
    for task, physics in _draws(reorient, 60):
        ups.append(task.object.label_pose(physics)[2, 0])
        assert not task.succeeded(physics)
    inverted = np.array(ups) < -0.97
    assert 0.3 < inverted.mean() < 0.7
    assert (np.abs(np.array(ups)[~inverted]) < 0.5).all()


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_mug_standing_is_a_success_wherever_its_handle_points(reorient, yaw):
    task = _reset(reorient, 1)
    asset = task.object.asset
    standing = int(np.argmax(label_ups(asset)[:, 0]))
    task.object.place(reorient.physics, pose_on_table(asset, standing, np.array([0.45, -0.1]), yaw))
    for _ in range(15):
        step = reorient.step(HOLD)
    assert step.reward == 1.0


def test_tools_have_no_upright():
    marker = catalogue.load("marker", 0)
    with pytest.raises(InputError, match="marker_000: is a functional tool"):
        tipped_poses(marker)


# At the shelf


def test_objects_start_by_in_and_under_the_shelf_and_overlap_nothing(position):
    levels = []
    for task, physics in _draws(position, 60):
        assert physics.data.contact.dist.min(initial=0.0) > -0.001
        pose_shelf = invert(task.shelf.pose(physics)) @ task.object.label_pose(physics)
        levels.append(_level(pose_shelf[:3, 3]))
        goal = invert(task.shelf.pose(physics)) @ task.goals[0].pose
        assert _level(goal[:3, 3]) in ("beside", "in")
    assert {"beside", "under", "in"} == set(levels)
    assert all(levels.count(level) > 8 for level in set(levels))


def test_a_tool_lies_within_the_walls_though_its_origin_is_beside_its_middle():
    hammer, shelf = catalogue.load("hammer", 0), PLACES.shelf
    assert np.linalg.norm(hammer.label.center) > 0.02
    low, high = hammer.label.bounds
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), -1).reshape(-1, 3)
    random_state, count = np.random.RandomState(0), 0
    for _ in range(200):
        shelf_pose = PLACES.draw_shelf(random_state)
        pose = PLACES.draw("in", hammer, 0, shelf_pose, random_state)
        if pose is None:
            continue
        count += 1
        x, y, _ = transform(invert(shelf_pose) @ pose @ hammer.label.pose, corners).T
        assert x.min() > 0 and x.max() < shelf.depth
        assert np.abs(y).max() < shelf.width / 2 - shelf.thickness
    assert count > 20


LEVELS = {"beside": None, "under": 0, "in": 1}


def _level(point: np.ndarray) -> str:
    shelf = PLACES.shelf
    if not (0 < point[0] < shelf.depth and abs(point[1]) < shelf.width / 2):
        return "beside"
    return "under" if point[2] < shelf.boards[0] else "in"


def test_the_shelf_stands_elsewhere_in_each_episode(position):
    poses = [task.shelf.pose(physics) for task, physics in _draws(position, 10)]
    places = np.array([pose[:2, 3] for pose in poses])
    assert np.ptp(places[:, 1]) > 0.2
    assert (np.linalg.norm(places, axis=1) > PLACES.distance[0] - 1e-6).all()
    # It stays clear of the arm at home, whose hand reaches 0.45 m.
    assert all(pose[0, 3] > 0.5 or abs(pose[1, 3]) > 0.15 for pose in poses)


@pytest.mark.parametrize("config", [PositionConfig(), IntoShelfConfig()])
def test_the_hand_has_room_for_one_grasp_at_both_ends(config, mug):
    draw = ShelfSampler(config.places, config.starts, config.goals, config.min_distance)
    random_state, both = np.random.RandomState(0), []
    for _ in range(12):
        shelf_pose = config.places.draw_shelf(random_state)
        poses = draw.draw(mug, [(2, 2), (0, 0)], shelf_pose, random_state)
        assert np.linalg.norm((poses[0] - poses[1])[:3, 3]) >= config.min_distance
        level = [_level((invert(shelf_pose) @ p @ mug.label.pose)[:3, 3]) for p in poses]
        room = [
            grasps_with_room(p @ mug.grasps.poses, shelf_pose, PLACES.shelf, LEVELS[name])
            for p, name in zip(poses, level, strict=True)
        ]
        both.append(int((room[0] & room[1]).sum()))
    assert np.mean(np.array(both) >= 4) > 0.9


def test_a_hand_has_room_in_front_of_a_level_and_none_through_a_board():
    shelf_pose = compose(np.eye(3), np.array([0.55, 0.0, 0.0]))
    level = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # along the shelf's x
    from_above = np.diag([1.0, -1.0, -1.0])
    at = np.array([0.65, 0.0, 0.15])
    poses = np.stack([compose(level, at), compose(from_above, at)])
    assert grasps_with_room(poses, shelf_pose, PLACES.shelf, 0).tolist() == [True, False]
    # Outside the shelf both are in the way of nothing; next to its wall the hand is.
    spots = np.array([[0.45, 0.0, 0.1], [0.47, 0.37, 0.1], [0.65, 0.37, 0.1]])
    aside = np.stack([compose(from_above, spot) for spot in spots[:2]])
    assert grasps_with_room(aside, shelf_pose, PLACES.shelf, None).tolist() == [True, True]
    wall = compose(from_above, spots[2])[None]
    assert not grasps_with_room(wall, shelf_pose, PLACES.shelf, None).any()
    far = compose(level, np.array([1.4, 0.0, 0.15]))[None]
    assert not grasps_with_room(far, shelf_pose, PLACES.shelf, 0).any()


@pytest.mark.parametrize(("board", "room"), [(0.41, False), (0.44, True)])
def test_a_hand_from_above_needs_room_for_the_arm_behind_it(board, room):
    shelf_pose = compose(np.eye(3), np.array([0.55, 0.0, 0.0]))
    pose = compose(np.diag([1.0, -1.0, -1.0]), np.array([0.65, 0.0, 0.02]))
    # Link 6 ends 296 mm behind the tcp; the hand backs off by 80 mm.
    shelf = ShelfConfig(boards=(board,))
    assert bool(grasps_with_room(pose[None], shelf_pose, shelf, 0)[0]) is room


def test_a_hand_has_no_room_through_a_wall():
    shelf_pose = compose(np.eye(3), np.array([0.55, 0.0, 0.0]))
    lying = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    # Its outer side would be beyond the wall.
    at = [compose(lying, np.array([0.6, y, 0.15])) for y in (0.0, 0.27)]
    assert grasps_with_room(np.stack(at), shelf_pose, PLACES.shelf, 0).tolist() == [True, False]


def test_the_open_hand_is_over_the_floor_or_it_is_not():
    level = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    at = np.array([0.6, 0.0, 0.03])
    poses = np.stack([compose(np.diag([1.0, -1.0, -1.0]), at), compose(level, at)])
    assert above_floor(poses, np.full(2, 0.02), 0.0).tolist() == [True, False]
    assert above_floor(poses, np.full(2, 0.02), -0.05).tolist() == [True, True]
    assert not above_floor(poses, np.full(2, 0.02), 0.02).any()


def test_zones_that_the_shelf_lacks_are_refused(mug):
    env_config = config("single_object/position")
    with pytest.raises(InputError, match="unknown zone 'inn'"):
        TargetPose((mug,), env_config, TargetPoseConfig(places=PLACES, starts=("inn",)))  # type: ignore[arg-type]
    low = ShelfPlaces(shelf=replace(PLACES.shelf, boards=(0.33,)))
    with pytest.raises(InputError, match="'in' lies between two boards"):
        TargetPose((mug,), env_config, TargetPoseConfig(places=low, goals=("in",)))


def test_an_object_that_fits_no_zone_is_refused(mug):
    rests = (StablePose(np.eye(3), 0.2, 1.0),)
    tall = replace(mug, label=replace(mug.label, extents=np.full(3, 0.4)), stable_poses=rests)
    draw = ShelfSampler(PLACES, ("under",), ("table",), 0.1)
    with pytest.raises(InputError, match="mug_000: fits the shelf in no stable pose"):
        draw.draw(tall, [(0, 0)], np.eye(4), np.random.RandomState(0))


# The family


def test_own_objects_are_used():
    box = catalogue.load("box", 1)
    for task in ("orientation", "position"):
        assert _reset(_environment(task, objects=[box]), 0).object_name == "box_001"
