"""Where furniture stands: the arm can use the part in question, on the table, on the floor or on a plinth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from dm_control import mjcf

from manipose_mj import suite
from manipose_mj.assets import catalogue
from manipose_mj.control.scene.collision_model import CollisionModel
from manipose_mj.mjcf.arena import SIDE_TABLE_CENTER, SIDE_TABLE_HALF_EXTENTS
from manipose_mj.poses import compose, rotation_about, rotation_angle
from manipose_mj.tasks.articulated import placement
from manipose_mj.tasks.articulated.hand_places import around_the_bar
from manipose_mj.tasks.articulated.part_shape import WIDE_OPEN, part_motion, part_shape
from manipose_mj.tasks.articulated.place_score import COMPLETE, LAYERS, TRAVEL, PlaceScore
from manipose_mj.tasks.articulated.placement import Standing, draw_place, fits_table
from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.core.start import Mount

_UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def nothing_fits_the_table(monkeypatch):
    """Every piece stands on the floor."""
    monkeypatch.setattr(placement, "_ON_TABLE", (0.1, 0.1, 0.1))
    placement._good_places.cache_clear()
    yield
    placement._good_places.cache_clear()


def _drawer():
    asset = catalogue.load("cabinet", 0)
    return asset, asset.part("top_drawer")


def test_the_same_generator_draws_the_same_place():
    asset, part = _drawer()
    one, two = (draw_place(np.random.RandomState(3), asset, part) for _ in range(2))
    assert one.yaw == two.yaw and (one.position == two.position).all()
    others = [draw_place(np.random.RandomState(seed), asset, part).yaw for seed in range(8)]
    assert len(set(others)) > 3


def test_a_place_within_reach_scores_higher_than_one_behind_or_far_away():
    asset, part = _drawer()
    shape = part_shape(asset, part)
    place = draw_place(np.random.RandomState(0), asset, part)
    good = compose(rotation_about(_UP, place.yaw), place.position)
    far = compose(np.eye(3), np.array([2.0, 0.0, 0.0]))
    through_the_robot = compose(np.eye(3), np.array([0.1, 0.0, 0.0]))
    score = PlaceScore(part, shape)(np.stack([good, far, through_the_robot]), np.zeros(3))
    assert score[0] >= COMPLETE and score[1] < 0.5 and score[2] < 0


def test_the_board_of_a_part_ends_behind_its_handle():
    for name, part_name in (("cabinet", "top_drawer"), ("microwave", "door")):
        asset = catalogue.load(name, 0)
        part = asset.part(part_name)
        shape = part_shape(asset, part)
        outwards = part.handle.rotation[:, 1]
        front = (shape.moving @ outwards).max()
        assert front < part.handle.origin @ outwards - part.handle.extents[1] / 2
        assert len(shape.fixed) >= 1 and fits_table(shape)


@pytest.mark.usefixtures("nothing_fits_the_table")
def test_what_is_too_large_for_the_table_stands_on_the_floor():
    asset, part = _drawer()
    shape = part_shape(asset, part)
    for seed in range(5):
        place = draw_place(np.random.RandomState(seed), asset, part)
        assert not place.mount.table and place.raised
        assert place.mount.height > 0
        assert place.position[2] + shape.floor > -place.mount.height
        handle = (rotation_about(_UP, place.yaw) @ part.handle.origin) + place.position
        assert 0.3 < np.hypot(*handle[:2]) < 0.9


def test_objects_have_room_beside():
    asset, part = _drawer()
    standing = Standing(objects=True)
    shape = part_shape(asset, part)
    for seed in range(5):
        place = draw_place(np.random.RandomState(seed), asset, part, standing=standing)
        low = rotation_about(_UP, place.yaw) @ shape.moving[0] + place.position
        high = rotation_about(_UP, place.yaw) @ shape.moving[1] + place.position
        assert max(low[1], high[1]) > -0.25


@pytest.mark.usefixtures("nothing_fits_the_table")
def test_a_scene_without_a_table_is_written_and_seen_by_planners():
    asset, _ = _drawer()
    environment = suite.load(
        "articulated", "open_top_drawer", seed=0, obs_mode="state", objects=[asset]
    )
    environment.reset(EpisodeSpec(0))
    task, physics = environment.task, environment.physics
    mount = task.start.mount
    assert not mount.table

    def height(name: str, physics: mjcf.Physics = physics) -> float:
        return float(physics.named.data.xpos[name, "z"])

    assert height("ground") == pytest.approx(-mount.height)
    assert height("pedestal") == 0.0 and height("table") < -5 and height("side_table") < -5
    base = task.furniture.base_pose(physics)
    plinth = f"{task.furniture.mjcf_model.model}/plinth"
    assert height(plinth) == pytest.approx(base[2, 3])
    model = CollisionModel(physics.model.ptr, task.robot.mjcf_model.model)
    data = model.forward(model.positions_of(physics.model.ptr, physics.data.qpos))
    for name in ("ground", "pedestal", "table", plinth):
        body = physics.model.body(name).id
        np.testing.assert_allclose(data.xpos[body], physics.data.xpos[body], atol=1e-9)
    # The next episode on the table finds it where it was.
    table = replace(task.start, mount=Mount())
    task.write(physics, table)
    assert height("table") == 0.0 and height("pedestal") < -5


def test_a_start_to_be_shut_is_searched_by_how_far_it_is_open():
    asset, part = _drawer()
    shape = part_shape(asset, part)
    place = draw_place(np.random.RandomState(0), asset, part, 0.8)
    base = compose(rotation_about(_UP, place.yaw), place.position)[None]
    assert PlaceScore(part, shape, LAYERS - 1)(base, np.zeros(1))[0] >= COMPLETE


@pytest.fixture
def few_good_places(monkeypatch):
    """Only those far to the left are good, which few candidates are; the others are poor. On the floor."""

    def scores(score, shape, places):
        assert score.shape is shape
        bearing = [np.arctan2(*place.position[1::-1]) for place in places]
        return np.where(np.array(bearing) > 1.55, COMPLETE + 0.01, 0.4)

    monkeypatch.setattr(placement, "_scores", scores)
    monkeypatch.setattr(placement, "_ON_TABLE", (0.1, 0.1, 0.1))
    placement._good_places.cache_clear()
    yield
    placement._good_places.cache_clear()


@pytest.mark.usefixtures("few_good_places")
def test_poor_places_are_drawn_from_no_more_once_there_is_a_good_one():
    key = placement._Key(*_drawer())
    places, best = placement._good_places(key, 0, Standing())
    bearings = [np.arctan2(*place.position[1::-1]) for place in places]
    assert best > COMPLETE and min(bearings) > 1.55
    # The first candidates alone have too few of them.
    rng, usual = np.random.RandomState(0), placement._BATCH * placement._BATCHES
    shape = part_shape(key.asset, key.part)
    first = [placement._drawn(rng, key.part, shape, Standing(), False) for _ in range(usual)]
    good = sum(np.arctan2(*place.position[1::-1]) > 1.55 for place in first)
    assert 0 < good < placement._ENOUGH <= len(places)


@pytest.mark.usefixtures("few_good_places")
def test_where_no_place_is_good_others_all_around_are_looked_at():
    key = placement._Key(*_drawer())
    ahead = Standing(bearing=(-0.1, 0.1), turn=(-0.1, 0.1), objects=True)
    places, best = placement._good_places(key, 0, ahead)
    assert best > COMPLETE and all(place.mount.side_table for place in places)


def test_a_door_is_not_put_where_it_comes_down_on_the_side_table():
    asset = catalogue.load("oven", 0)
    (part,) = (part for part in asset.parts if part.handle is not None)
    shape = part_shape(asset, part)
    score = PlaceScore(part, shape)
    rng = np.random.RandomState(0)
    beside = Standing(objects=True)
    drawn = [placement._drawn(rng, part, shape, beside, False) for _ in range(128)]
    alone = [replace(place, mount=replace(place.mount, side_table=0.0)) for place in drawn]
    with_table, without = (placement._scores(score, shape, places) for places in (drawn, alone))
    refused = (with_table < 0) & (without >= 0)
    assert refused.any() and (with_table[~refused] == without[~refused]).all()
    openings = np.linspace(*part.joint.range, LAYERS)
    for place in np.array(drawn, object)[refused]:
        top = np.array(SIDE_TABLE_CENTER) * [1.0, place.mount.side_table, 1.0]
        base = compose(rotation_about(_UP, place.yaw), place.position)
        boxes = [(base, box) for box in shape.fixed]
        boxes += [(base @ part_motion(part, q), shape.moving) for q in openings]
        near = np.array([0.1, 0.1, 0.1]) + SIDE_TABLE_HALF_EXTENTS
        assert any(_overlap(pose, box, top, near) for pose, box in boxes)


def _overlap(pose, box, middle, half) -> bool:
    """Whether any of many points of a box is within half extents of a point."""
    shares = np.stack(np.meshgrid(*[np.linspace(0, 1, 9)] * 3), axis=-1).reshape(-1, 3)
    points = (box[0] + shares * (box[1] - box[0])) @ pose[:3, :3].T + pose[:3, 3]
    return bool((np.abs(points - middle) < half).all(axis=1).any())


def test_a_door_that_cannot_be_shut_from_wide_open_starts_no_wider_than_was_looked_at(monkeypatch):
    asset, part = _drawer()
    monkeypatch.setattr(placement, "_good_places", lambda *_: ((), 0.2))
    looked_at = TRAVEL * np.linspace(0, 1, LAYERS)[LAYERS // 2]
    assert placement.widest_start(asset, part) == pytest.approx(looked_at)


def test_a_door_that_folds_back_need_be_open_only_so_far_that_a_hand_passes():
    asset = catalogue.load("microwave", 0)
    part = asset.part("door")
    shape = part_shape(asset, part)
    folding = replace(part, joint=replace(part.joint, range=(0.0, np.pi)))
    far = PlaceScore(folding, shape)._motions()[-1]
    enough = PlaceScore(folding, shape, back=True)._motions()[-1]
    assert rotation_angle(far[:3, :3], np.eye(3)) == pytest.approx(TRAVEL * np.pi)
    assert rotation_angle(enough[:3, :3], np.eye(3)) == pytest.approx(WIDE_OPEN)


def test_fingertips_need_less_room_behind_a_handle():
    asset = catalogue.load("cabinet", 0)
    part = asset.part("top_drawer")
    usual, tips = (
        around_the_bar(part, fingertips=fingertips)[0].poses for fingertips in (False, True)
    )
    out = part.handle.rotation[:, 1]
    further = (tips[:, :3, 3] - usual[:, :3, 3]) @ out
    assert (further > 0).all()
    # A wall right behind the handle leaves room for the tips alone.
    front = float(part.handle.origin @ out) + part.handle.extents[1] / 2
    shape = part_shape(asset, part)
    axis = int(np.abs(out).argmax())
    wall = shape.moving.copy()
    wall[int(out[axis] > 0), axis] = out[axis] * (front - 0.009)
    close = replace(shape, moving=wall)
    base = _good_base(asset, part)
    scores = [
        PlaceScore(part, close, fingertips=fingertips)(base, np.full(len(base), -2.0)).max()
        for fingertips in (False, True)
    ]
    assert scores[0] < 0.5 < scores[1]


def _good_base(asset, part) -> np.ndarray:
    """Where the part can be opened, `(n, 4, 4)`."""
    places = [draw_place(np.random.RandomState(seed), asset, part) for seed in range(8)]
    return np.stack([compose(rotation_about(_UP, place.yaw), place.position) for place in places])
