"""A drawer that stands open shows by its front, though nobody found its handle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.furniture.pulled_out import as_it_moved, pulled_out
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.boxes import no_boxes
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.poses import SymmetryGroup

FRONT = 0.2
X = np.array([1.0, 0.0, 0.0])


def face(x: float, low: list[float], high: list[float], step: float = 0.006) -> np.ndarray:
    """Noisy points of a rectangle that faces X."""
    grid = np.meshgrid(np.arange(low[0], high[0], step), np.arange(low[1], high[1], step))
    points = np.column_stack([np.full(grid[0].size, x), grid[0].ravel(), grid[1].ravel()])
    return points + np.random.default_rng(0).normal(0, 0.001, points.shape)


def cabinet() -> FurnitureModel:
    """Taken for one with a shut drawer below, which has got the name of the upper one."""
    origin = np.array([FRONT + 0.03, 0.0, 0.1])
    handle = PoseLabel(
        origin, np.eye(3), "handle", np.full(3, 0.02), SymmetryGroup(np.eye(3)[None])
    )
    drawer = MovingPart("top_drawer", Joint("slide", origin, X, (0.0, 0.3)), handle, None)
    panel = np.array([[FRONT - 0.018, -0.2, 0.0], [FRONT, 0.2, 0.2]])
    part = PartModel(drawer, panel, no_boxes(), 0.0, 0.9, np.zeros((0, 3)))
    solid = np.array([[[-0.2, -0.25, 0.0], [FRONT, 0.25, 0.5]]])
    return FurnitureModel(np.eye(4), solid, (part,), "cabinet")


def cloud(*faces: np.ndarray) -> SceneCloud:
    points = np.concatenate(faces)
    return SceneCloud(points, np.tile(X, (len(points), 1)), np.ones(len(points), int))


SHUT = face(FRONT, [-0.25, 0.0], [0.25, 0.2])


@pytest.mark.parametrize("opening", [0.08, 0.25])
def test_a_front_that_stands_out_of_the_body_is_a_drawers(opening):
    out = face(FRONT + opening, [-0.2, 0.22], [0.2, 0.40])
    found = pulled_out(cabinet(), cloud(SHUT, out), "top_drawer")
    assert found is not None
    assert [part.name for part in found.parts] == ["part_1", "top_drawer"]
    drawer = found.parts[-1]
    assert drawer.opening == pytest.approx(opening, abs=0.003)
    np.testing.assert_allclose(
        drawer.panel, [[FRONT - 0.018, -0.2, 0.22], [FRONT, 0.2, 0.40]], atol=0.01
    )
    assert drawer.part.joint.range[1] >= opening
    cavity = drawer.part.cavity
    assert cavity is not None
    assert cavity.moves_with_part


def test_handles_and_what_is_beside_the_body_are_no_drawers():
    handle = face(FRONT + 0.045, [-0.06, 0.09], [0.06, 0.11], 0.002)
    beside = face(FRONT + 0.2, [0.35, 0.1], [0.6, 0.3])
    assert pulled_out(cabinet(), cloud(SHUT, handle, beside), "top_drawer") is None


def led(opening: float) -> PartModel:
    """Of all that is taken for its front, the lower two thirds are other fronts."""
    (drawer,) = cabinet().parts
    panel = np.array([[FRONT - 0.018, -0.2, 0.0], [FRONT, 0.2, 0.45]])
    looks = face(FRONT, [-0.2, 0.0], [0.2, 0.45], 0.01)
    drawer = replace(drawer, panel=panel, looks=looks)
    return drawer.at(opening).opening_to(0.3)


@pytest.mark.parametrize("felt", [0.25, 0.27, 0.33])
def test_what_stayed_behind_as_a_drawer_was_led_out_is_not_its_front(felt):
    out = face(FRONT + 0.25, [-0.2, 0.30], [0.2, 0.45], 0.004)
    behind = face(FRONT, [-0.2, 0.0], [0.2, 0.30], 0.004)
    part = as_it_moved(led(felt), np.concatenate([out, behind]))
    np.testing.assert_allclose(part.panel[:, 2], [0.30, 0.45], atol=0.015)
    assert part.opening == pytest.approx(0.25, abs=0.005)


def test_a_drawer_that_the_hand_slipped_off_is_what_it_was():
    shut = face(FRONT, [-0.2, 0.0], [0.2, 0.45], 0.004)
    before = led(0.25)
    assert as_it_moved(before, shut) is before


def test_parts_that_make_room_get_names_of_their_own():
    (drawer,) = cabinet().parts
    names = ("part_0", "top_drawer", "part_3")
    parts = [replace(drawer, part=replace(drawer.part, name=name)) for name in names]
    model = replace(cabinet(), parts=tuple(parts)).with_another(parts[1])
    assert [part.name for part in model.parts] == ["part_0", "part_4", "part_3", "top_drawer"]
