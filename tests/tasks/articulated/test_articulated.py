"""Drawers and doors: which part a task is about, what fits behind it, and when each task is done."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from dm_control import composer

from asset_pipeline.build.articulated import build_articulated
from asset_pipeline.sources.partnet_mobility import objects as partnet_mobility
from manipose_mj import suite
from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import ASSET_FILE, MODEL_FILE
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.poses import compose, invert, transform
from manipose_mj.tasks.articulated.cavity_placement import resting, ways_to_lie
from manipose_mj.tasks.articulated.open_close import OpenClose
from manipose_mj.tasks.articulated.part_choice import PartChoice, kind_of, possible_parts
from manipose_mj.tasks.articulated.part_room import outwards_of, room_at
from manipose_mj.tasks.articulated.registered import OPENABLES
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.registry import named_task
from manipose_mj.tasks.core.scene_source import SceneSource
from manipose_mj.tasks.core.start import NoStartError
from manipose_mj.tasks.goals.conditions import inside_cavity
from tests.few_objects import load
from tests.places import REAL_DATA

HOLD = np.append(HOME, MAX_OPENING)
# Turned to the back, where no drawer and no door meets the arm.
BACKWARDS = np.append([2.8, *HOME[1:]], MAX_OPENING)
ARCHIVE = REAL_DATA / "partnet_mobility.tar.xz"
needs_data = pytest.mark.skipif(
    not ARCHIVE.is_file(),
    reason=f"no {ARCHIVE}; set MANIPOSE_REAL_DATA to a folder with partnet_mobility.tar.xz",
)


def _load(task: str, **options) -> composer.Environment:
    environment = load("articulated", task, seed=0, obs_mode="state", **options)
    environment.reset()
    return environment


def _reset(environment: composer.Environment, seed: int):
    environment.random_state.seed(seed)
    environment.reset()
    return environment.task, environment.physics


def _set(environment: composer.Environment, fraction: float) -> None:
    task, physics = environment.task, environment.physics
    low, high = task.part.joint.range
    joint = physics.bind(task.furniture.joint(task.part.name))
    joint.qpos, joint.qvel = low + fraction * (high - low), 0.0


def test_every_verb_is_registered_for_every_part():
    names = {name for domain, name in suite.ALL_TASKS if domain == "articulated"}
    assert names == {"store_chips_can_middle_drawer"} | {
        f"{verb}_{part}" for verb in ("open", "close", "store", "take_out") for part in OPENABLES
    }


@pytest.mark.parametrize(
    ("level", "name"),
    [("top", "top_drawer"), ("middle", "middle_drawer"), ("bottom", "bottom_drawer")],
)
def test_the_level_of_a_drawer_is_its_height(level, name):
    asset = catalogue.load("cabinet", 0)
    (part,) = possible_parts(asset, PartChoice(("drawer",), level), hollow=True)
    assert part.name == name


def test_a_users_piece_has_a_middle_drawer_whatever_its_layout():
    asset = catalogue.load("cabinet", 0)
    drawers = {p.name: p for p in asset.parts if kind_of(p) == "drawer"}
    middle = PartChoice(("drawer",), "middle")
    for names, expected in (
        (("top_drawer", "bottom_drawer"), "top_drawer"),
        (("bottom_drawer",), "bottom_drawer"),
    ):
        piece = replace(asset, parts=tuple(drawers[name] for name in names))
        with pytest.raises(InputError, match="no middle drawer"):
            possible_parts(piece, middle, hollow=True)
        (part,) = possible_parts(piece, replace(middle, any_layout=True), hollow=True)
        assert part.name == expected
        own = EnvConfig("articulated/open_middle_drawer", objects=(piece,))
        scenes = SceneSource(named_task(own.task), own)
        assert [[spec.part for spec in group] for group in scenes.strata()] == [[expected]]


def _as(category: str, name: str):
    """A cabinet under another category and name."""
    return replace(catalogue.load("cabinet", 0), category=category, name=name)


def _pieces(task: str, *objects) -> set[str]:
    own = EnvConfig(f"articulated/{task}", objects=objects)
    scenes = SceneSource(named_task(own.task), own)
    drawn = [scenes.draw(np.random.RandomState(seed), EpisodeSpec()) for seed in range(12)]
    names = {scene.assets[0].name for scene in drawn if scene is not None}
    assert names == {spec.furniture for group in scenes.strata() for spec in group}
    return names


@pytest.mark.parametrize("verb", ["open", "take_out"])
def test_a_users_furniture_of_the_kind_that_a_task_is_named_for_comes_first(verb, caplog):
    pieces = [_as(name, name) for name in ("cabinet", "table", "microwave", "dishwasher", "safe")]
    pieces.append(catalogue.load("mug", 0))
    assert _pieces(f"{verb}_microwave", *pieces) == {"microwave"}
    assert _pieces(f"{verb}_oven", *pieces) == {"dishwasher"}
    assert _pieces(f"{verb}_top_drawer", *pieces) == {"cabinet", "table"}
    assert not caplog.records
    own = EnvConfig(f"articulated/{verb}_microwave", objects=pieces)
    named = SceneSource(named_task(own.task), own).draw(
        np.random.RandomState(0), EpisodeSpec(furniture="safe")
    )
    assert named is not None and named.assets[0].name == "safe"


def test_other_furniture_serves_where_none_of_the_kind_has_such_a_part_and_a_warning_says_so(
    caplog,
):
    doorless = replace(_as("microwave", "microwave"), parts=())
    assert _pieces("open_microwave", doorless, _as("safe", "safe")) == {"safe"}
    (record,) = caplog.records
    assert "articulated/open_microwave: no microwave has a part for it" in record.message
    assert "\n" not in record.message


def test_a_part_that_is_not_there_is_refused_with_those_that_are():
    microwave = catalogue.load("microwave", 0)
    with pytest.raises(InputError, match=r"no top drawer with a handle; its parts: door \(door\)"):
        possible_parts(microwave, PartChoice(("drawer",), "top"), hollow=False)
    assert kind_of(catalogue.load("oven", 7).part("door")) == "flap"


def test_a_sliding_door_is_no_drawer():
    asset = catalogue.load("cabinet", 0)
    drawer = asset.part("top_drawer")
    aside = replace(drawer, joint=replace(drawer.joint, axis=np.array([0.0, 1, 0])))
    assert (kind_of(drawer), kind_of(aside)) == ("drawer", "sliding door")
    with pytest.raises(InputError, match=r"its parts: top_drawer \(sliding door\)"):
        possible_parts(replace(asset, parts=(aside,)), PartChoice(("drawer", "door")), hollow=False)


def test_a_part_that_is_asked_for_without_a_piece_is_of_a_piece_that_has_it(tmp_path):
    one = _as("cabinet", "one")
    folder = shutil.copytree(one.folder, tmp_path / "other")
    for file, name in ((ASSET_FILE, '"name": "door"'), (MODEL_FILE, 'name="door"')):
        text = (folder / file).read_text(encoding="utf-8")
        assert name in text
        text = text.replace(name, name.replace("door", "door_1"))
        (folder / file).write_text(text, encoding="utf-8")
    other = replace(read_asset(folder), name="other")
    own = EnvConfig("articulated/open_cabinet_door", objects=(one, other))
    scenes = SceneSource(named_task(own.task), own)
    for seed in range(8):
        drawn = scenes.draw(np.random.RandomState(seed), EpisodeSpec(part="door_1"))
        assert drawn is not None and (drawn.assets[0].name, drawn.part) == ("other", "door_1")
    for part, piece, message in (
        ("top", None, "^unknown part 'top'; known: door, door_1$"),
        ("top_drawer", None, "^unknown part 'top_drawer'; known: door, door_1$"),
        ("door_1", "one", "^unknown part of one 'door_1'; did you mean door\\?$"),
        ("top_drawer", "one", "this task is about door; part 'top_drawer' is none of them$"),
    ):
        with pytest.raises(InputError, match=message):
            scenes.draw(np.random.RandomState(0), EpisodeSpec(part=part, furniture=piece))


@pytest.mark.sample(3)
@pytest.mark.parametrize("part", OPENABLES)
def test_open_is_met_from_nine_tenths_of_the_range_on(part):
    environment = _load(f"open_{part}")
    for seed in range(3):
        task, physics = _reset(environment, seed)
        assert environment.step(HOLD).reward == 0.0
        task.robot.set_configuration(physics, BACKWARDS[:7], MAX_OPENING)
        _set(environment, 0.88)
        assert environment.step(BACKWARDS).reward == 0.0
        _set(environment, 0.92)
        assert environment.step(BACKWARDS).reward == 1.0
        assert task.part.name in [p.name for p in task.furniture.asset.parts]


def test_a_task_without_a_rigid_object_says_so():
    task = _load("open_microwave").task
    said = "^task articulated/open_microwave: no rigid object is in play; "
    with pytest.raises(InputError, match=said + "it has `articulated_objects` alone$"):
        _ = task.object
    task.start = None
    with pytest.raises(InputError, match=said + "reset it first$"):
        _ = task.object


@pytest.mark.parametrize("part", ["top_drawer", "cabinet_door", "oven"])
def test_close_starts_open_and_is_met_when_shut(part):
    environment = _load(f"close_{part}")
    low, high = OPENABLES[part].start_open
    for seed in range(3):
        task, physics = _reset(environment, seed)
        fraction = float(task.scene_state(physics).parts[task.part.name].fraction)
        assert low - 0.01 < fraction < high + 0.01  # it stays where it was put
        assert environment.step(HOLD).reward == 0.0
        _set(environment, 0.08)
        assert environment.step(HOLD).reward == 1.0


@pytest.mark.parametrize("part", ["middle_drawer", "microwave"])
def test_what_is_inside_lies_inside_at_rest_and_apart(part):
    environment = _load(f"store_{part}")
    counts = []
    for seed in range(8):
        task, physics = _reset(environment, seed)
        state = task.scene_state(physics)
        others = [name for name in task.objects if name != "object"]
        counts.append(len(others))
        cavity = state.parts[task.part.name].cavity_pose
        for name in others:
            place = (invert(cavity) @ state.objects[name].label_pose)[:3, 3]
            assert (np.abs(place) < task.part.cavity.extents / 2).all()
            assert state.objects[name].linear_speed < 0.01
        assert physics.data.contact.dist.min(initial=0.0) > -0.002
        assert not task.success_now
    assert {0, 1} <= set(counts) <= {0, 1, 2}


def test_fitting_is_by_stable_poses():
    cavity = catalogue.load("microwave", 0).part("door").cavity
    can = catalogue.load("chips_can", 0)
    assert cavity is not None
    ways = ways_to_lie(can, cavity)
    assert ways
    for stable, _ in ways:  # 25 cm tall: only lying
        assert abs((can.stable_poses[stable].rotation @ can.label.rotation)[2, 0]) < 0.1


def test_every_way_to_lie_in_a_cavity_counts_as_inside():
    cavity = catalogue.load("microwave", 0).part("door").cavity
    assert cavity is not None
    for name in ("mug", "chips_can", "box"):
        asset = catalogue.load(name, 0)
        for stable, yaw in ways_to_lie(asset, cavity):
            pose = resting(asset, stable, yaw).pose(cavity, np.zeros(2)) @ asset.label.pose
            extents, axial = asset.label.extents, asset.label.symmetry.axial
            assert inside_cavity(pose, extents, axial, cavity.extents, 0.002), (name, stable)
            sunk = compose(np.eye(3), np.array([0.0, 0.0, -0.15])) @ pose
            assert not inside_cavity(sunk, extents, axial, cavity.extents, 0.002)


def test_a_tool_lies_about_the_middle_of_its_box():
    pencil = catalogue.load("pencil", 4)
    assert abs(pencil.label.center[0]) > 0.04  # its origin is near its point
    lying = resting(pencil, 0, 0.4)
    ends = np.array([[-0.5, 0, 0], [0.5, 0, 0]]) * pencil.label.extents + pencil.label.center
    middle = transform(pencil.label.pose, ends) @ lying.rotation.T
    np.testing.assert_allclose(middle.mean(axis=0)[:2], lying.center, atol=1e-6)


def test_taken_out_is_met_on_the_marked_area_with_the_drawer_shut():
    environment = _load("take_out_top_drawer")
    task, physics = _reset(environment, 1)
    assert environment.step(HOLD).reward == 0.0
    goal = task.goals[0]
    rest = task.object.asset.stable_poses[0]
    label = rest.rotation @ task.object.asset.label.origin
    outside = np.array([*(goal.center - label[:2]), rest.height + 0.001])

    def put(offset: float) -> float:
        shift = np.array([0.0, offset, 0.0])
        task.object.place(physics, compose(rest.rotation, outside + shift))
        for _ in range(20):
            step = environment.step(HOLD)
        return step.reward

    assert put(0.0) == 1.0
    assert put(goal.half_sides[1] + 0.01) == 0.0
    assert put(0.0) == 1.0
    _set(environment, 0.5)
    assert environment.step(HOLD).reward == 0.0


def test_what_a_task_cannot_use_is_refused_in_one_line():
    wide = catalogue.load("box", 0)
    with pytest.raises(
        InputError, match="tasks that open or close take articulated ones"
    ) as caught:
        _load("open_microwave", objects=[wide])
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no bottom drawer"):
        _load("store_bottom_drawer", objects=[catalogue.load("oven", 7)])
    with pytest.raises(
        InputError, match=r"^chips_can_000: measures .* fits the cavity .* no stable pose"
    ):
        _load("store_cabinet_door", objects=[_shallow(), catalogue.load("chips_can", 0)])


def _shallow():
    """A cabinet behind whose door nothing fits."""
    asset = catalogue.load("cabinet", 0)
    parts = []
    for part in asset.parts:
        assert part.cavity is not None
        small = replace(part.cavity, extents=part.cavity.extents * 0.1)
        parts.append(replace(part, cavity=small))
    return replace(asset, parts=tuple(parts))


def test_a_part_without_a_cavity_is_refused_for_storing_but_can_be_opened():
    asset = catalogue.load("cabinet", 0)
    solid = replace(asset, parts=tuple(replace(p, cavity=None) for p in asset.parts))
    with pytest.raises(InputError, match="'top_drawer' opens no cavity"):
        _load("store_top_drawer", objects=[solid])
    task, _ = _reset(_load("open_top_drawer", objects=[solid]), 0)
    assert task.object_name == "cabinet_000"


@pytest.mark.full
@needs_data
def test_furniture_of_partnet_mobility_serves(tmp_path):
    item = next(i for i in partnet_mobility.items(ARCHIVE) if i.name == "46236")
    with partnet_mobility.opened(item) as scan:
        asset = build_articulated(scan, tmp_path / item.name)
    # Of the built-in objects those that fit, or one's own.
    assert len(_load("store_bottom_drawer", objects=[asset]).task.pool.entities) == 3
    environment = _load("store_bottom_drawer", objects=[asset, catalogue.load("can", 1)])
    task, _ = _reset(environment, 0)
    assert task.furniture.asset.name == "46236" and task.object_name == "can_001"
    environment.step(HOLD)
    assert task.max_penetration < 0.005
    assert not task.success_now


@pytest.mark.full
@pytest.mark.parametrize("part", ["top_drawer", "cabinet_door"])
def test_what_is_taken_out_lies_where_a_hand_gets_at_it(part):
    environment = _load(f"take_out_{part}")
    for seed in range(4):
        task, physics = _reset(environment, seed)
        entity, cavity = task.objects["object"], task.cavity_pose(physics)
        pose = entity.object_pose(physics)
        alike = [rest.rotation[2] @ pose[2, :3] for rest in entity.asset.stable_poses]
        stable, at = int(np.argmax(alike)), invert(cavity) @ pose
        assert room_at(entity.asset, task.part, stable, at, cavity_world=cavity) >= 3


def test_a_start_in_which_no_hand_gets_at_the_object_is_none():
    environment = _load("take_out_top_drawer")
    task, physics = environment.task, environment.physics
    placed, cavity = task.start.objects["object"], task.cavity_pose(physics)
    at = invert(cavity) @ placed.pose
    # To the wall at the back, which stays under what the drawer is pulled out of.
    back = -outwards_of(task.part) * task.part.cavity.extents[:2]
    reach = task.objects["object"].asset.label.reach(
        at[:3, :3] @ task.objects["object"].asset.label.rotation
    )
    at[:2, 3] = back / 2 - np.sign(back) * (reach[:2] + 0.01)
    objects = {**task.start.objects, "object": replace(placed, pose=cavity @ at)}
    with pytest.raises(NoStartError, match="no hand gets at it"):
        task.write(physics, replace(task.start, objects=objects))


def test_a_part_that_the_hand_at_home_pushes_shut_is_drawn_again():
    frozen = protocol.load("v1").episode("articulated/close_middle_drawer", 15)
    env = suite.load("articulated", "close_middle_drawer", split="test", obs_mode="state")
    env.reset(EpisodeSpec(**frozen.asked))
    task = env.task
    assert isinstance(task, OpenClose) and not task.succeeded(env.physics)
    low, high = task.part.joint.range
    (now,) = task.pieces.opening(env.physics, 0)
    assert abs(now - task.start.furniture[0].openings[task.part.name]) < 0.1 * (high - low)
    assert now > low + 0.5 * (high - low)


def test_a_part_that_the_arm_at_home_is_in_is_drawn_again():
    env = _load("close_microwave")
    task, physics = env.task, env.physics
    start, placed = task.start, task.start.furniture[0]
    # The middle of the open door to where the hand is.
    door = physics.bind(task.furniture.mjcf_model.find("body", task.part.name)).xipos
    there = replace(placed, position=placed.position + task.robot.tcp_pose(physics)[:3, 3] - door)
    with pytest.raises(NoStartError, match="door of microwave_"):
        task.write(physics, replace(start, furniture=(there,)))
    task.write(physics, start)
