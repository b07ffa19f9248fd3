"""The shelf: boards where its levels say, things rest on them, the hand gets in, it moves at no cost."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from dm_control import mjcf

from manipose_mj.assets import catalogue
from manipose_mj.errors import InputError
from manipose_mj.mjcf.arena import TableArena
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.mjcf.panda.geometry import BOXES
from manipose_mj.mjcf.shelf import MIN_GAP, Shelf, ShelfConfig
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.scene.resting import pose_on_table

STANDING = compose(rotation_about(np.array([0.0, 0.0, 1.0]), 0.3), np.array([0.55, 0.1, 0.0]))
MUG_UPRIGHT = 2


@pytest.fixture(scope="module")
def scene() -> tuple[mjcf.Physics, Shelf, RigidObject]:
    arena, shelf = TableArena(), Shelf(ShelfConfig(back=True))
    arena.mjcf_model.option.flag.sleep = "disable"  # what sleeps touches nothing
    mug = RigidObject(catalogue.load("mug", 0), name="mug")
    arena.attach(shelf)
    arena.add_free_entity(mug)
    return mjcf.Physics.from_mjcf_model(arena.mjcf_model), shelf, mug


@pytest.mark.parametrize("level", [0, 1, 2])
def test_a_mug_rests_on_every_level(scene, level):
    physics, shelf, mug = scene
    floor, _ = shelf.config.levels[level]
    xy = (STANDING @ np.array([0.13, -0.1, 0.0, 1.0]))[:2]
    with physics.reset_context():
        shelf.place(physics, STANDING)
        mug.place(physics, pose_on_table(mug.asset, MUG_UPRIGHT, xy, 0.4, floor))
    before = mug.object_pose(physics)
    support = set()
    for _ in range(30):
        physics.step(20)
        support |= {
            physics.model.id2name(int(g), "geom") for g in physics.data.contact.geom.ravel()
        }
    np.testing.assert_allclose(mug.object_pose(physics)[:3, 3], before[:3, 3], atol=1e-3)
    assert max(mug.speeds(physics)) < 0.01
    support = {name for name in support if not name.startswith("mug/")}
    assert support == {["table", "shelf/board_0", "shelf/board_1"][level]}


def test_free_heights_are_what_a_ray_measures(scene):
    physics, shelf, mug = scene
    with physics.reset_context():
        shelf.place(physics, STANDING)
        mug.place(physics, compose(np.eye(3), np.array([0.0, 0.0, 5.0])))
    for floor, height in shelf.config.levels[:-1]:
        start = STANDING @ np.array([0.1, 0.2, floor + 0.01, 1.0])
        met = np.zeros(1, np.int32)
        distance = mujoco.mj_ray(
            physics.model.ptr, physics.data.ptr, start[:3], np.array([0.0, 0.0, 1.0]),
            None, 1, -1, met,
        )  # fmt: skip
        assert distance + 0.01 == pytest.approx(height, abs=1e-9)
    assert np.isinf(shelf.config.levels[-1][1])


def test_its_boxes_meet_but_do_not_overlap(scene):
    _, shelf, _ = scene
    centres, halves = shelf.boxes
    assert len(centres) == 5
    for i in range(len(centres)):
        for j in range(i):
            overlap = halves[i] + halves[j] - np.abs(centres[i] - centres[j])
            assert overlap.min() < 1e-9, (i, j)
    low, high = (centres - halves).min(axis=0), (centres + halves).max(axis=0)
    np.testing.assert_allclose(low, [0.0, -0.36, 0.0], atol=1e-9)
    np.testing.assert_allclose(high, [0.278, 0.36, 0.66], atol=1e-9)


def test_the_hand_fits_between_boards_lying_and_between_walls_standing(scene):
    _, shelf, _ = scene
    low, high = np.array(BOXES["hand"]).min(axis=(0, 1)), np.array(BOXES["hand"]).max(axis=(0, 1))
    across = float((high - low)[1])
    assert across > 0.2
    assert shelf.config.width - 2 * shelf.config.thickness > across + 0.1
    assert all(height > across + 0.05 for _, height in shelf.config.levels)
    assert min(high[2] - low[2], across) < MIN_GAP


def test_no_shelf_without_a_back_has_one():
    assert len(Shelf(ShelfConfig(back=False)).boxes[0]) == 4
    assert len(Shelf(ShelfConfig(boards=(0.3, 0.6, 0.9), back=False)).boxes[0]) == 5


@pytest.mark.parametrize(
    "sizes",
    [{"boards": ()}, {"boards": (0.1,)}, {"boards": (0.3, 0.4)}, {"width": 0.03}, {"depth": 0.0}],
)
def test_shelves_without_room_are_refused(sizes):
    with pytest.raises(InputError) as caught:
        ShelfConfig(**sizes)
    assert "\n" not in str(caught.value)
