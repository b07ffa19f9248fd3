"""Where furniture stands: the arm can use the part in question, on the table, on the floor or on a plinth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from dm_control import mjcf

from manipose_mj import suite
from manipose_mj.assets import catalogue
from manipose_mj.control.scene.collision_model import CollisionModel
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.articulated import placement
from manipose_mj.tasks.articulated.part_shape import part_shape
from manipose_mj.tasks.articulated.place_score import COMPLETE, LAYERS, PlaceScore
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
