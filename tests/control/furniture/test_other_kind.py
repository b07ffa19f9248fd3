"""Doors that were taken for drawers, and drawers that were taken for doors."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.furniture.other_kind import as_door, as_drawer
from manipose_mj.control.furniture.shapes.boxes import no_boxes
from manipose_mj.control.furniture.shapes.furniture_model import PartModel
from manipose_mj.control.furniture.shapes.handle_shape import ACROSS_FRONT, UP_FRONT
from manipose_mj.poses import SymmetryGroup

X, Y, Z = np.eye(3)
PANEL = np.array([[0.18, -0.3, 0.1], [0.20, 0.1, 0.6]])


def part(
    axis: np.ndarray, kind: str = "hinge", opening: float = 0.0, level: bool = False
) -> PartModel:
    """With its handle near its left edge, or, level, across its middle."""
    place = np.array([0.23, -0.1, 0.35] if level else [0.23, 0.07, 0.4])
    handle = PoseLabel(
        place,
        ACROSS_FRONT if level else UP_FRONT,
        "handle",
        np.array([0.3 if level else 0.1, 0.01, 0.01]),
        SymmetryGroup(np.eye(3)[None]),
    )
    joint = Joint(kind, np.array([0.2, -0.3, 0.3]), axis, (0.0, 0.3))
    moving = MovingPart("front", joint, handle, None)
    return PartModel(moving, PANEL, no_boxes(), opening, 0.4, np.zeros((0, 3)))


@pytest.mark.parametrize(("axis", "kind"), [(X, "slide"), (X, "hinge"), (Y + Z, "hinge")])
def test_what_words_call_a_door_turns_about_the_edge_far_from_its_handle(axis, kind):
    door = as_door(part(axis / np.linalg.norm(axis), kind), "microwave", -0.2)
    joint, cavity = door.part.joint, door.part.cavity
    assert joint.kind == "hinge"
    np.testing.assert_allclose(joint.axis, -Z)
    assert joint.origin[1] == pytest.approx(-0.3)
    assert cavity is not None
    assert not cavity.moves_with_part
    assert cavity.center[0] - cavity.extents[0] / 2 > -0.2
    # It opens outwards.
    handle = door.part.handle
    assert handle is not None
    assert np.cross(joint.axis, handle.origin - joint.origin)[0] > 0


def test_a_wide_bar_makes_it_a_flap():
    door = as_door(part(X, "slide", level=True), "oven", -0.2)
    np.testing.assert_allclose(door.part.joint.axis, Y)


def test_a_hinge_that_a_door_may_have_stays():
    upright = part(-Z)
    assert as_door(upright, "cabinet", -0.2) is upright
    opened = part((Y - Z) / np.sqrt(2), "hinge", 0.7)
    assert as_door(opened, "cabinet", -0.2) is opened


def test_what_would_turn_as_a_knob_is_no_open_door():
    door = as_door(part(X, "hinge", 0.7), "cabinet", -0.2)
    np.testing.assert_allclose(door.part.joint.axis, -Z)
    assert door.opening == 0.0


def test_what_words_call_a_drawer_slides_out_of_the_front():
    drawer = as_drawer(part(-Z))
    assert drawer.part.joint.kind == "slide"
    np.testing.assert_allclose(drawer.part.joint.axis, X)
    cavity = drawer.part.cavity
    assert cavity is not None
    assert cavity.moves_with_part
