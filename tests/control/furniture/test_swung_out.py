"""A door that stands open shows by its panel, and so does its hinge, whoever found its handle or not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.fit.furniture_fit import fit_furniture
from manipose_mj.control.furniture.sensing.part_sensing import SensedFurniture
from manipose_mj.control.furniture.shapes.boxes import no_boxes
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.control.furniture.swung_out import (
    as_large_as,
    as_seen_open,
    open_door_of,
    swung_out,
    with_open_door,
)
from manipose_mj.poses import compose, rotation_about
from tests.control.furniture.synthetic import FRONT, HALF, HEIGHT, body, cloud, door, rectangle

X, Y, Z = np.eye(3)
MODEL = FurnitureModel(
    np.eye(4), np.array([[[-FRONT, -HALF, 0.0], [FRONT + 0.03, HALF, HEIGHT]]]), (), "cabinet"
)


@pytest.mark.parametrize("hinge", [-HALF, HALF])
@pytest.mark.parametrize("opening", [0.8, 1.9, 2.8, 3.1])
@pytest.mark.parametrize("faces", ["outer", "inner", "outer inner"])
def test_a_panel_that_stands_out_of_an_edge_is_a_doors(hinge, opening, faces):
    found = swung_out(MODEL, cloud(body() + door(hinge, opening, faces)))
    assert found is not None
    part = found.sensed
    assert part.kind == "hinge"
    assert part.opening == pytest.approx(opening, abs=0.02)
    np.testing.assert_allclose(part.axis, np.sign(hinge) * Z, atol=1e-6)
    np.testing.assert_allclose(part.origin[:2], [FRONT, hinge], atol=0.012)
    assert found.handle_seen == ("outer" in faces)


def test_its_handle_is_where_points_stand_out_of_its_panel():
    found = swung_out(MODEL, cloud(body() + door(-HALF, 1.9, "outer inner")))
    assert found is not None
    part = found.sensed
    turn = rotation_about(part.axis, -part.opening)
    shut = turn @ (part.handle[:3, 3] - part.origin) + part.origin
    np.testing.assert_allclose(shut, [FRONT + 0.05, -0.15 * HALF, 0.25], atol=0.02)


def test_what_is_shut_or_stands_beside_the_body_is_no_door():
    assert swung_out(MODEL, cloud(body())) is None
    beside = rectangle(np.array([0.3, -0.9, 0.0]), 0.3 * X, HEIGHT * Z, Y)
    assert swung_out(MODEL, cloud([*body(), beside])) is None


@pytest.mark.parametrize("faces", ["inner", "outer inner"])
def test_a_door_takes_the_place_of_what_was_sensed_on_it(faces):
    found = swung_out(MODEL, cloud(body() + door(-HALF, 1.9, faces)))
    assert found is not None
    part = found.sensed
    beside = part.handle.copy()
    beside[:3, 3] += [0.02, 0.0, 0.05]
    twice = [
        replace(part, handle=beside, confidence=c, origin=part.origin + 0.07) for c in (0.2, 0.4)
    ]
    other = replace(part, handle=compose(np.eye(3), np.array([0.2, 0.2, 0.4])))
    sensed = with_open_door(SensedFurniture(X, (other, *twice)), found)
    # Where points show no handle, what was sensed is better than a guess.
    handle = part.handle if found.handle_seen else beside
    np.testing.assert_allclose(sensed.parts[0].handle, handle)
    np.testing.assert_allclose(sensed.parts[0].origin, part.origin)
    assert sensed.parts[1:] == (other,)
    assert with_open_door(SensedFurniture(X, (other,)), found).parts == (part, other)


@pytest.mark.parametrize("off", [0.0, 0.2, np.pi / 2, -np.pi / 2])
def test_a_front_that_was_taken_for_a_side_is_where_the_door_leaves_a_hole(off):
    front, *sides = body()
    shut = front[0][:, 1] > 0.02  # the door has left the other half
    half = (front[0][shut], front[1][shut])
    corner, depth, width = np.array([-FRONT, -HALF, 0.0]), 2 * FRONT * X, 2 * HALF * Y
    inside = [rectangle(corner, width, HEIGHT * Z, X), rectangle(corner, depth, width, Z)]
    seen = cloud([half, *sides, *inside, *door(-HALF, 1.3, "outer inner")])
    door_itself = swung_out(MODEL, seen)
    assert door_itself is not None
    parts = (replace(door_itself.sensed, confidence=0.3),)
    sensed = SensedFurniture(np.array([np.cos(off), np.sin(off), 0.0]), parts)
    found = open_door_of(seen, sensed, fit_furniture(seen, sensed, "cabinet"))
    assert found is not None
    turned, opened = found
    assert turned.front @ X > 0.97
    assert opened.fits
    np.testing.assert_allclose(opened.sensed.origin[:2], [FRONT, -HALF], atol=0.012)


def test_a_door_is_no_smaller_than_its_panel_shows():
    found = swung_out(MODEL, cloud(body() + door(-HALF, 1.9, "outer inner")))
    assert found is not None
    joint = Joint("hinge", np.array([FRONT, -HALF, 0.0]), -Z, (0.0, 1.8))
    panel = np.array([[FRONT - 0.018, -HALF, 0.1], [FRONT, 0.0, 0.3]])  # a neighbour's handle
    moving = MovingPart("door", joint, None, None)
    part = PartModel(moving, panel, no_boxes(), 1.9, 0.5, np.zeros((0, 3)))
    low, high = as_large_as(part, found).panel
    assert low[2] == pytest.approx(0.0, abs=0.02)
    assert high[2] == pytest.approx(HEIGHT, abs=0.02)
    assert [low[0], high[0]] == [panel[0, 0], panel[1, 0]]


def test_a_door_that_was_led_open_turns_about_the_hinge_that_its_panel_shows():
    found = swung_out(MODEL, cloud(body() + door(-HALF, 1.9, "outer inner")))
    assert found is not None
    joint = Joint("hinge", np.array([0.1, -0.2, 0.0]), -Z, (0.0, 1.8))
    part = PartModel(
        MovingPart("door", joint, None, None),
        np.zeros((2, 3)),
        no_boxes(),
        1.6,
        0.5,
        np.zeros((0, 3)),
    )
    seen = as_seen_open(part, found, np.eye(4))
    assert seen.opening == pytest.approx(1.9, abs=0.02)
    assert seen.part.joint.range[1] == seen.opening
    np.testing.assert_allclose(seen.part.joint.origin[:2], [FRONT, -HALF], atol=0.012)
