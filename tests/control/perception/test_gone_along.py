"""What lies in a drawer goes along with it, whether or not anybody sees it."""

from __future__ import annotations

import numpy as np

from manipose_mj.assets.asset import Cavity, MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.shapes.boxes import no_boxes
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.control.perception.sensed_world import gone_along
from manipose_mj.poses import compose

X = np.array([1.0, 0.0, 0.0])


def furniture(opening: float) -> FurnitureModel:
    """A drawer behind a front that is at X = 0, turned by a half about the vertical at (1, 0)."""
    cavity = Cavity(np.array([-0.15, 0.0, 0.1]), np.array([0.3, 0.3, 0.2]), moves_with_part=True)
    part = MovingPart("drawer", Joint("slide", np.zeros(3), X, (0.0, 0.3)), None, cavity)
    panel = np.array([[-0.02, -0.15, 0.0], [0.0, 0.15, 0.2]])
    drawer = PartModel(part, panel, no_boxes(), opening, 0.9, np.zeros((0, 3)))
    pose = compose(np.diag([-1.0, -1.0, 1.0]), X)
    return FurnitureModel(
        pose, np.array([[[-0.4, -0.2, 0.0], [0.0, 0.2, 0.5]]]), (drawer,), "cabinet"
    )


def test_objects_in_a_drawer_that_is_shut_go_in_with_it():
    inside, beside = (
        compose(np.eye(3), np.array(place)) for place in ([0.9, 0.0, 0.05], [0.9, 0.3, 0.05])
    )
    moved = gone_along(furniture(0.25), furniture(0.0), {"inside": inside, "beside": beside})
    assert moved.keys() == {"inside"}
    np.testing.assert_allclose(moved["inside"], compose(np.eye(3), np.array([1.15, 0.0, 0.05])))
    assert not gone_along(furniture(0.25), furniture(0.25), {"inside": inside})
