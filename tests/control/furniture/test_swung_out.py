"""A door that stands open shows by its panel, and so does its hinge, whoever found its handle or not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.boxes import no_boxes
from manipose_mj.control.furniture.furniture_model import FurnitureModel, PartModel
from manipose_mj.control.furniture.part_sensing import SensedFurniture, with_open_door
from manipose_mj.control.furniture.swung_out import as_seen_open, swung_out
from manipose_mj.poses import compose, rotation_about
from tests.control.furniture.synthetic import FRONT, HALF, HEIGHT, body, cloud, door, rectangle

X, Y, Z = np.eye(3)
MODEL = FurnitureModel(
    np.eye(4), np.array([[[-FRONT, -HALF, 0.0], [FRONT + 0.03, HALF, HEIGHT]]]), (), "cabinet"
)


@pytest.mark.parametrize("hinge", [-HALF, HALF])
@pytest.mark.parametrize("opening", [0.8, 1.9])
@pytest.mark.parametrize("faces", ["outer", "inner", "outer inner"])
def test_a_panel_that_stands_out_of_an_edge_is_a_doors(hinge, opening, faces):
    found = swung_out(MODEL, cloud(body() + door(hinge, opening, faces)))
    assert found is not None
    assert found.kind == "hinge"
    assert found.opening == pytest.approx(opening, abs=0.02)
    np.testing.assert_allclose(found.axis, np.sign(hinge) * Z, atol=1e-6)
    np.testing.assert_allclose(found.origin[:2], [FRONT, hinge], atol=0.012)


def test_its_handle_is_where_points_stand_out_of_its_panel():
    found = swung_out(MODEL, cloud(body() + door(-HALF, 1.9, "outer inner")))
    assert found is not None
    turn = rotation_about(found.axis, -found.opening)
    shut = turn @ (found.handle[:3, 3] - found.origin) + found.origin
    np.testing.assert_allclose(shut, [FRONT + 0.05, -0.15 * HALF, 0.25], atol=0.02)


def test_what_is_shut_or_stands_beside_the_body_is_no_door():
    assert swung_out(MODEL, cloud(body())) is None
    beside = rectangle(np.array([0.3, -0.9, 0.0]), 0.3 * X, HEIGHT * Z, Y)
    assert swung_out(MODEL, cloud([*body(), beside])) is None


def test_a_panel_corrects_the_joint_of_the_part_that_has_its_handle_there():
    found = swung_out(MODEL, cloud(body() + door(-HALF, 1.9, "outer inner")))
    assert found is not None
    handle = found.handle.copy()
    handle[:3, 3] += 0.05
    other = replace(found, handle=compose(np.eye(3), np.array([0.2, 0.2, 0.4])))
    taken = replace(found, handle=handle, origin=found.origin + 0.07, confidence=0.4)
    sensed = with_open_door(SensedFurniture(X, (other, taken)), found)
    np.testing.assert_allclose(sensed.parts[0].handle, handle)
    np.testing.assert_allclose(sensed.parts[0].origin, found.origin)
    assert sensed.parts[1:] == (other,)
    assert with_open_door(SensedFurniture(X, (other,)), found).parts == (found, other)


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
