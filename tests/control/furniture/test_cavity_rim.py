"""What shows of an opening behind a door: its frame, and the surface in it that carries objects."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.furniture.cavity_rim import seen_rim, tallest_compartment
from manipose_mj.control.furniture.opened_part import seen_open
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.boxes import no_boxes
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.poses import SymmetryGroup, transform

# An oven's opening in a front at 0.2, 2 cm behind the front of its door; its panel as first guessed is larger.
PANEL = np.array([[0.18, -0.25, 0.0], [0.20, 0.25, 0.30]])
MOUTH, LEFT, RIGHT, ROOF, FLOOR, RACK, REAR = 0.178, -0.20, 0.14, 0.25, 0.03, 0.08, -0.2
X, Y, Z = np.eye(3)


def sheet(low, high, normal, step: float = 0.006) -> tuple[np.ndarray, np.ndarray]:
    """Noisy points of a box without a third side, and their normals."""
    axes = [
        np.arange(a, b, step) if b - a > 1e-9 else np.array([a])
        for a, b in zip(low, high, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    noise = np.random.default_rng(0).normal(0, 0.001, points.shape)
    return points + noise, np.tile(normal, (len(points), 1))


def oven(rack: bool) -> tuple[np.ndarray, np.ndarray]:
    sheets = [
        sheet([MOUTH, -0.25, 0.0], [MOUTH, LEFT, 0.30], X),
        sheet([MOUTH, RIGHT, 0.0], [MOUTH, 0.25, 0.30], X),
        sheet([MOUTH, LEFT, ROOF], [MOUTH, RIGHT, 0.30], X),
        sheet([REAR, LEFT, FLOOR], [REAR, RIGHT, ROOF], X),
        sheet([REAR, LEFT, FLOOR], [MOUTH, RIGHT, FLOOR], Z),
    ]
    if rack:
        sheets += [
            sheet([REAR, y, RACK], [MOUTH, y + 0.004, RACK], Z)
            for y in np.arange(LEFT, RIGHT, 0.025)
        ]
    return tuple(np.concatenate(each) for each in zip(*sheets, strict=True))


@pytest.mark.parametrize("aside", [0.0, 0.002, 0.004, 0.006, 0.008])
def test_the_frame_says_where_the_opening_is(aside):
    points, normals = oven(rack=False)
    rim = seen_rim(points + [0.0, aside, 0.0], normals, PANEL)
    found = [rim.mouth, rim.left, rim.right, rim.roof]
    assert found == pytest.approx([MOUTH, LEFT + aside, RIGHT + aside, ROOF], abs=0.003)


def test_without_a_frame_nothing_is_said_of_it():
    points, normals = oven(rack=False)
    inner = points[:, 0] < MOUTH - 0.01
    rim = seen_rim(points[inner], normals[inner], PANEL)
    assert (rim.mouth, rim.left, rim.right, rim.roof) == (None,) * 4


@pytest.mark.parametrize(("rack", "height"), [(False, FLOOR), (True, RACK)])
def test_objects_stand_on_a_rack_though_the_floor_shows_through_it(rack, height):
    points, normals = oven(rack)
    inside = points[:, 0] < MOUTH - 0.01
    space = tallest_compartment(points, inside, normals, ROOF)
    assert space is not None
    assert (space.floor, space.roof) == (pytest.approx(height, abs=0.003), ROOF)


@pytest.mark.parametrize(
    ("shelves", "floor", "roof"),
    [((0.145,), FLOOR, 0.125), ((0.10,), 0.10, ROOF), ((0.16, 0.21), FLOOR, 0.14)],
)
def test_shelves_divide_what_is_behind_a_door(shelves, floor, roof):
    points, normals = oven(rack=False)
    boards = [sheet([REAR, LEFT, z], [MOUTH, RIGHT, z], Z) for z in shelves]
    points = np.concatenate([points, *(board[0] for board in boards)])
    normals = np.concatenate([normals, *(board[1] for board in boards)])
    space = tallest_compartment(points, points[:, 0] < MOUTH - 0.01, normals, ROOF)
    assert space is not None
    assert [space.floor, space.roof] == pytest.approx([floor, roof], abs=0.003)


def opened_oven() -> tuple[FurnitureModel, PartModel]:
    """Its door open."""
    handle = PoseLabel(
        np.zeros(3), np.eye(3), "handle", np.full(3, 0.02), SymmetryGroup(np.eye(3)[None])
    )
    joint = Joint("hinge", np.array([0.2, -0.25, 0.1]), -Z, (0.0, 1.8))
    door = PartModel(
        MovingPart("door", joint, handle, None), PANEL, no_boxes(), 1.6, 0.9, np.zeros((0, 3))
    )
    solid = np.array([[[-0.22, -0.3, 0.0], [0.2, 0.3, 0.32]]])
    return FurnitureModel(np.eye(4), solid, (door,), "oven"), door


def test_an_open_door_shows_the_whole_cavity_and_where_it_ends_itself():
    points, normals = oven(rack=True)
    model, door = opened_oven()
    # The door's own free edge is where its opening ends, not where the panel was guessed to.
    face, across = sheet([0.18, -0.25, 0.0], [0.18, RIGHT + 0.01, 0.30], X)
    motion = door.motion(door.opening)
    points = np.concatenate([points, transform(motion, face)])
    normals = np.concatenate([normals, across @ motion[:3, :3].T])
    found = seen_open(model, door, SceneCloud(points, normals, np.ones(len(points), int)))
    np.testing.assert_allclose(found.panel[:, 1:], [[-0.25, 0.0], [RIGHT + 0.01, 0.30]], atol=0.01)
    cavity = found.part.cavity
    assert cavity is not None
    low, high = cavity.center - cavity.extents / 2, cavity.center + cavity.extents / 2
    np.testing.assert_allclose(low, [REAR, LEFT, RACK], atol=0.016)
    np.testing.assert_allclose(high, [MOUTH, RIGHT, ROOF], atol=0.018)
    # Nothing that is put into what was found sticks out of what there is.
    assert (low > [REAR - 0.002, LEFT - 0.002, RACK - 0.003]).all()
    assert (high < [MOUTH + 0.002, RIGHT + 0.002, ROOF + 0.002]).all()


def test_normals_that_face_the_front_by_chance_are_no_rear_wall():
    """Where objects hide it, a few points of floor and sides do."""
    points, normals = oven(rack=False)
    shown = (points[:, 0] > REAR + 0.01) | (normals[:, 2] > 0.5)
    points, normals = points[shown], normals[shown].copy()
    inside = np.flatnonzero(np.abs(points[:, 0] - 0.02) < 0.08)
    normals[np.random.default_rng(0).choice(inside, 60, replace=False)] = X
    model, door = opened_oven()
    found = seen_open(model, door, SceneCloud(points, normals, np.ones(len(points), int)))
    assert found.part.cavity is not None
    low = found.part.cavity.center - found.part.cavity.extents / 2
    assert low[0] == pytest.approx(REAR, abs=0.025)
