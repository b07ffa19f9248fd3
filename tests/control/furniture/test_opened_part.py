"""What stands open is as large as it shows, and as the hole that it leaves where no camera sees it end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.opened_part import reaching_unseen, seen_open, with_extra
from manipose_mj.control.furniture.shapes.boxes import no_boxes
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.poses import transform
from tests.control.furniture.synthetic import FRONT, HALF, HEIGHT, THICKNESS, body, cloud, door

X, Y, Z = np.eye(3)
SOLID = np.array([[[-FRONT, -HALF, 0.0], [FRONT, HALF, HEIGHT]]])
PANEL = np.array([[FRONT - 0.01, -HALF, 0.0], [FRONT + 0.02, -0.1, HEIGHT]])
DOOR = PartModel(
    MovingPart("door", Joint("hinge", np.array([FRONT, -HALF, 0.0]), -Z, (0.0, 1.8)), None, None),
    PANEL,
    no_boxes(),
    1.3,
    1.0,
    np.zeros((0, 3)),
)
MODEL = FurnitureModel(np.eye(4), SOLID, (DOOR,), "cabinet")


def test_the_hand_keeps_clear_of_all_that_is_seen_on_a_door():
    seen = with_extra(MODEL, DOOR, cloud(body() + door(-HALF, 1.3, "outer inner")))
    # The bar, which nobody took for a handle, and what of the door is beyond its panel.
    low, high = seen.extra[:, 0].min(axis=0), seen.extra[:, 1].max(axis=0)
    assert high[0] == pytest.approx(FRONT + 0.05, abs=0.03)
    assert high[1] == pytest.approx(0.0, abs=0.03)
    assert low[1] > -HALF / 2
    # All of it moves with the door: nothing of the body is among it.
    assert len(with_extra(MODEL, replace(DOOR, panel=PANEL), cloud(body())).extra) == 0


@pytest.mark.parametrize("thickness", [0.03, 0.045])
def test_an_open_door_is_as_thick_as_it_shows(thickness):
    outer, bar, inner = door(-HALF, 1.3, "outer inner")
    deeper = DOOR.motion(1.3)[:3, :3] @ X * (thickness - THICKNESS)
    seen = seen_open(MODEL, DOOR, cloud([*body(), outer, bar, (inner[0] - deeper, inner[1])]))
    assert np.ptp(seen.panel[:, 0]) == pytest.approx(thickness, abs=0.004)
    # Whose inside does not show keeps its thickness.
    unseen = seen_open(MODEL, DOOR, cloud([*body(), outer, bar]))
    assert unseen.panel[0, 0] == PANEL[0, 0]


def _holed_front():
    """A front with a hole from the left side to 0."""
    front, *sides = body()
    shut = front[0][:, 1] > 0.0
    return cloud([(front[0][shut], front[1][shut]), *sides])


def test_a_door_whose_end_no_camera_sees_is_as_large_as_its_hole():
    found = reaching_unseen(MODEL, DOOR, _holed_front(), lambda points: np.zeros(len(points), bool))
    np.testing.assert_allclose(found.panel[:, 1], [-HALF, 0.0], atol=0.021)
    np.testing.assert_allclose(found.panel[:, 2], [0.0, HEIGHT], atol=0.021)


def test_a_door_ends_where_a_camera_looks_past_it():
    turned = DOOR.motion(DOOR.opening)

    def past(points):
        return transform(np.linalg.inv(turned), points)[:, 1] > PANEL[1, 1]

    found = reaching_unseen(MODEL, DOOR, _holed_front(), past)
    assert found.panel[1, 1] == PANEL[1, 1]


def test_a_shut_front_makes_no_door_larger():
    found = reaching_unseen(MODEL, DOOR, cloud(body()), lambda points: np.zeros(len(points), bool))
    assert found.panel[1, 1] == PANEL[1, 1]
