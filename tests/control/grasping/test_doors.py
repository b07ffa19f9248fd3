"""Drawers and doors: the hand follows the handle's arc, turning about it, and pushes objects shut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.baseline import Baseline
from manipose_mj.control.execution import primitives
from manipose_mj.control.grasping import part_pick
from manipose_mj.control.grasping.handle_grasps import (
    Push,
    grip_now,
    grips,
    opening_pushes,
    shutting_pushes,
)
from manipose_mj.control.grasping.part_motion import PartWay, find_way
from manipose_mj.control.grasping.part_pick import (
    HELD,
    _closes_on,
    grip_handle,
    is_a_stage,
    leads_enough,
    way_in_hand,
)
from manipose_mj.control.grasping.part_push import push_part
from manipose_mj.control.grasping.pick import pick_part
from manipose_mj.control.motion.batch_ik import solve
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan_articulated import OPEN_SHARE, opening_to_pass
from manipose_mj.control.scene.articulation import joint_motion, with_part_at
from manipose_mj.control.scene.cavity_mouth import outwards, way_out
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.evaluation.episode import run_episode
from manipose_mj.failures import StageFailure
from manipose_mj.poses import invert, rotation_angle
from manipose_mj.tasks.articulated.part_shape import WIDE_OPEN
from manipose_mj.tasks.core.config import EpisodeSpec
from tests.few_objects import config, load

# Seeds for which the baseline, with true poses, is known to do it.
SOLVED = {
    "open_cabinet_door": 0,
    "open_oven": 1,
    "open_bottom_drawer": 0,
    "close_microwave": 0,
    "close_oven": 0,
    "close_top_drawer": 0,
    "store_microwave": 1,
    "take_out_oven": 0,
}


@pytest.fixture(scope="module", params=["open_cabinet_door", "open_oven"])
def scene(request) -> tuple[MotionPlanner, SceneEstimate, PartEstimate]:
    environment = load("articulated", request.param, seed=0, obs_mode="state")
    environment.reset()
    baseline = Baseline(environment)
    estimate = baseline.perception.observe()
    planner = MotionPlanner(estimate.scene, baseline.arm, 0.02, np.random.default_rng(0))
    return planner, estimate, estimate.parts[environment.task.part.name]


def _way(scene, hold, opening: float, part: PartEstimate | None = None) -> PartWay | None:
    planner, estimate, own = scene
    return find_way(planner, part or own, hold, opening, near=estimate.joints)


@pytest.mark.sample(1)
def test_a_gripped_handle_is_led_along_its_arc(scene):
    planner, _, part = scene
    goal = part.joint.range[0] + 0.9 * np.ptp(part.joint.range)
    ways = [way for hold in grips(part) if (way := _way(scene, hold, goal)) is not None]
    way = max(ways, key=lambda way: way.openings[-1])
    assert way.openings[-1] == pytest.approx(goal)
    for joints, opening, tilt in list(zip(way.joints, way.openings, way.tilts, strict=True))[::5]:
        moved = part.base_pose @ joint_motion(part, float(opening))
        requested = moved @ way.hold.tcp_poses(np.array([tilt]))[0]
        reached = planner.tcp_pose(joints)
        assert np.linalg.norm(reached[:3, 3] - requested[:3, 3]) < 1e-3
        assert rotation_angle(reached[:3, :3], requested[:3, :3]) < 5e-3
        # Wherever it tilts, the hand stays on the bar.
        on_bar = invert(moved @ part.handle.pose) @ reached
        assert np.linalg.norm(on_bar[1:3, 3]) < 1e-3
    targets = way.targets(0.02)
    assert np.abs(np.diff(targets, axis=0)).max() < 0.06
    np.testing.assert_allclose(targets[-1], way.joints[-1], atol=1e-6)


def test_fingertips_hold_a_bar_by_its_front(scene):
    _, _, part = scene
    front = part.handle.origin + part.handle.rotation[:, 1] * part.handle.extents[1] / 2
    usual = [_before(hold, part, front) for hold in grips(part)]
    tips = [_before(hold, part, front) for hold in grips(part, "fingertips")]
    assert tips and min(tips) > max(usual)
    # The pads still overlap the bar.
    assert min(tips) > 0.0 and max(tips) < 0.004


def test_knobs_are_held_deeper_in_stages_than_usual(scene):
    _, _, part = scene
    handle = replace(part.handle, extents=np.array([0.02, 0.016, 0.02]))
    knob = replace(part, handle=handle)
    front = handle.origin + handle.rotation[:, 1] * handle.extents[1] / 2
    # The middle of a knob is behind its front by half its depth; the usual grips are there or right at its front.
    usual = {round(_before(hold, knob, front), 6) for hold in grips(knob)}
    deep = {round(_before(hold, knob, front), 6) for hold in grips(knob, "deep")}
    assert usual == {-0.008, 0.0}
    assert deep == {-0.006, -0.004, -0.002}
    assert not list(grips(part, "deep"))


def test_a_wide_bar_is_not_held_askew(scene):
    _, _, part = scene
    along, depth, _ = part.handle.extents
    wide = replace(part, handle=replace(part.handle, extents=np.array([along, depth, 0.032])))
    goal = part.joint.range[0] + 0.4 * np.ptp(part.joint.range)
    ways = [way for hold in grips(wide) if (way := _way(scene, hold, goal, wide)) is not None]
    assert ways and all(np.abs(way.tilts).max() < 0.3 for way in ways)
    # Its middle may be estimated too far out.
    front = part.handle.origin + part.handle.rotation[:, 1] * depth / 2
    deep = [_before(hold, wide, front) for hold in grips(wide, "deep")]
    assert deep and max(deep) < -depth / 2
    # Fingers turn about a thin bar, and about a knob.
    knob = replace(part, handle=replace(part.handle, extents=np.array([0.03, depth, 0.03])))
    for other in (part, knob):
        assert all(np.abs(hold.tilts).max() > 1.0 for hold in grips(other))


def test_a_knob_that_is_followed_is_held_such_that_the_hand_turns_with_the_door():
    environment = load(
        "articulated", "open_cabinet_door", seed=2, objects="cabinet_009", obs_mode="state"
    )
    environment.reset()
    baseline = Baseline(environment)
    estimate = baseline.perception.observe()
    planner = MotionPlanner(estimate.scene, baseline.arm, 0.02, np.random.default_rng(0))
    part = estimate.parts[environment.task.part.name]
    assert part.handle.extents[0] < 0.04
    grip = grip_handle(planner, estimate, part, part.joint.range[1], following=True)
    hinge = part.base_pose[:3, :3] @ part.joint.axis
    assert abs(planner.tcp_pose(grip.approach[-1])[:3, 0] @ hinge) > 0.9


def test_a_long_bar_may_be_held_away_from_its_middle_where_there_is_any_of_it(scene, monkeypatch):
    planner, estimate, part = scene
    along = [hold.upright[0, 3] for hold in grips(part, "aside")]
    usual = [hold.upright[0, 3] for hold in grips(part)]
    half = part.handle.extents[0] / 2
    assert min(np.abs(along)) > max(np.abs(usual)) and max(np.abs(along)) < half
    ways = [
        way
        for hold in grips(part, "aside")
        if (way := _way(scene, hold, part.joint.range[1])) is not None
    ]
    assert ways and all(_closes_on(planner, part, way) for way in ways)
    # A hand's width before it there is nothing.
    away = solve(planner.backed_off(ways[0].joints[0], 0.05)[None], ways[0].joints[None, :1])[0][0]
    before = replace(ways[0], joints=np.repeat(away, len(ways[0].joints), axis=0))
    assert not _closes_on(planner, part, before)
    # The middle will not do: the grip is one of these.
    monkeypatch.setattr(part_pick, "_FIRM_KINDS", ("aside",))
    grip = grip_handle(planner, estimate, part, part.joint.range[1], in_stages=True)
    tcp = invert(part.handle_pose) @ planner.tcp_pose(grip.approach[-1])
    assert min(abs(abs(tcp[0, 3]) - abs(slide)) for slide in along) < 2e-3


def test_where_an_estimate_lets_no_hand_get_off_it_may_be_the_estimate(scene, monkeypatch):
    planner, estimate, part = scene
    ending = part_pick.ending_free
    monkeypatch.setattr(
        part_pick, "ending_free", lambda *way: ending(*way) if way[3:] == (HELD,) else None
    )
    goal = part.joint.range[1]
    with pytest.raises(StageFailure, match="none can be approached"):
        grip_handle(planner, estimate, part, goal)
    assert len(grip_handle(planner, estimate, part, goal, following=True).approach)


def _before(hold, part: PartEstimate, front: np.ndarray) -> float:
    """How far the untilted hand's TCP is before the front of the handle [m]."""
    tcp = hold.tcp_poses(np.array([0.0]))[0]
    return float((tcp[:3, 3] - front) @ part.handle.rotation[:, 1])


def test_a_short_way_is_a_stage(scene):
    _, _, part = scene
    hold = next(grips(part))

    def way(end: float) -> PartWay:
        openings = np.array([part.opening, part.opening + end])
        return PartWay(hold, np.zeros((2, 7)), openings, np.zeros(2))

    assert is_a_stage(way(0.3), part) and not is_a_stage(way(0.1), part)
    assert not leads_enough(way(0.3), part, part.joint.range[1])


def test_the_hold_of_now_is_the_grip_it_came_from(scene):
    _, _, part = scene
    for hold in list(grips(part))[:2]:
        for tilt in (-0.5, 0.0, 0.7):
            tcp = part.pose @ hold.tcp_poses(np.array([tilt]))[0]
            now = grip_now(part, tcp, 0.01)
            assert now.straight == pytest.approx(tilt, abs=1e-6)
            np.testing.assert_allclose(now.upright, hold.upright, atol=1e-9)


def test_pushes_press_from_the_side_that_moves_the_part(scene):
    planner, _, part = scene
    low, high = part.joint.range
    half_open = replace(part, opening=0.5 * (low + high))
    pairs = ((shutting_pushes(planner, part), -1.0), (opening_pushes(planner, half_open), 1.0))
    for pushes, sign in pairs:
        for push in list(pushes)[:6]:
            assert isinstance(push, Push)
            velocity = np.cross(part.joint.axis, push.point - part.joint.origin)
            assert sign * float(-push.normal @ velocity) > 0
            tcp = push.tcp_poses(np.array([0.0]))[0]
            np.testing.assert_allclose(tcp[:3, 2], -push.normal, atol=1e-9)
            assert 0.005 < (tcp[:3, 3] - push.point) @ push.normal < 0.012  # the tips touch


def test_a_way_that_is_blocked_ends_before_the_obstacle(scene, monkeypatch):
    planner, _, part = scene
    low, high = part.joint.range
    at = low + 0.5 * (high - low)
    free = PlanningScene.first_collision
    address = planner.scene.collision_model.joint_address(part.body)

    def collides(self, joints, query=None):
        opening = self.positions.qpos[address]
        return ("wall", "arm", -0.01) if opening > at else free(self, joints, query)

    monkeypatch.setattr(PlanningScene, "first_collision", collides)
    ways = [_way(scene, hold, high) for hold in list(grips(part))[:2]]
    ends = [way.openings[-1] for way in ways if way is not None]
    assert ends and all(low < end <= at for end in ends)


def test_in_stages_a_push_that_leads_part_of_the_way_will_do(scene, monkeypatch):
    planner, estimate, part = scene
    low, high = part.joint.range
    half_open = replace(part, opening=low + 0.6 * (high - low))
    at_half = planner.within(with_part_at(planner.scene, part, half_open.opening))
    barrier = low + 0.3 * (high - low)
    free = PlanningScene.first_collision
    address = planner.scene.collision_model.joint_address(part.body)

    def collides(self, joints, query=None):
        opening = self.positions.qpos[address]
        return ("wall", "arm", -0.01) if opening < barrier else free(self, joints, query)

    monkeypatch.setattr(PlanningScene, "first_collision", collides)
    with pytest.raises(StageFailure, match="0 of them lead all the way"):
        push_part(at_half, estimate, half_open, low)
    push = push_part(at_half, estimate, half_open, low, in_stages=True)
    assert barrier <= push.way.openings[-1] < half_open.opening - 0.2
    assert is_a_stage(push.way, half_open)


def test_doors_that_fold_back_are_opened_so_far_that_a_hand_passes(scene):
    _, _, part = scene
    low, high = part.joint.range
    assert opening_to_pass(part) == pytest.approx(low + OPEN_SHARE * (high - low))
    folding = replace(part, joint=replace(part.joint, range=(0.0, np.pi)))
    assert opening_to_pass(folding) == pytest.approx(WIDE_OPEN)


def _refuse(*_arguments, **_options):
    raise StageFailure("plan", "refused")


def test_parts_are_pushed_in_stages_once_no_plan_moves_them_at_once(monkeypatch):
    calls = []

    def push(*arguments, in_stages: bool):
        calls.append(in_stages)
        return push_part(*arguments) if in_stages else _refuse()

    monkeypatch.setattr(primitives, "push_part", push)
    monkeypatch.setattr(primitives, "pick_part", _refuse)
    result, _ = run_episode(config("articulated/close_microwave", obs_mode="state"), EpisodeSpec(0))
    assert result.success_at_end, (result.failure, result.reason)
    # First all plans without; then again with.
    assert calls[0] is False and calls[-1] is True
    assert calls == sorted(calls)


def test_in_stages_a_door_without_a_grip_is_pushed_on_from_inside(monkeypatch):
    """Led ajar it can be gripped no more: the plan's next push goes on from there."""
    gripped = []

    def pick(*arguments, in_stages: bool, following: bool):
        gripped.append(in_stages)
        return pick_part(*arguments) if len(gripped) == 1 else _refuse()

    def push(*arguments, in_stages: bool):
        return push_part(*arguments) if in_stages else _refuse()

    def ajar(planner, estimate, part, _):
        return way_in_hand(planner, estimate, part, part.joint.range[0] + 0.75)

    monkeypatch.setattr(primitives, "pick_part", pick)
    monkeypatch.setattr(primitives, "push_part", push)
    monkeypatch.setattr(primitives, "way_in_hand", ajar)
    result, _ = run_episode(config("articulated/open_microwave", obs_mode="state"), EpisodeSpec(0))
    assert result.success_at_end, (result.failure, result.reason)
    assert gripped == [False, True]


def test_the_way_out_of_a_cavity_behind_a_door_is_through_its_mouth(scene):
    _, estimate, part = scene
    assert part.cavity is not None
    inside = (part.base_pose @ np.append(part.cavity.center, 1.0))[:3]
    way = way_out(estimate, inside)
    assert way is not None and abs(way[2]) < 1e-9
    local = part.base_pose[:3, :3].T @ way
    assert local @ outwards(part) == pytest.approx(np.linalg.norm(way))
    after = inside + way
    moved = (invert(part.base_pose) @ np.append(after, 1.0))[:3] - part.cavity.center
    assert (np.abs(moved) > part.cavity.extents / 2).any()
    assert way_out(estimate, inside + [0.0, 0.0, 2.0]) is None


@pytest.mark.full
@pytest.mark.parametrize("task", SOLVED)
def test_the_baseline_does_it(task):
    result, _ = run_episode(
        config(f"articulated/{task}", obs_mode="state"), EpisodeSpec(SOLVED[task])
    )
    assert result.success_at_end, (result.failure, result.reason)
    assert result.max_penetration < 0.003
