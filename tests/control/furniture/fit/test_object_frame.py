"""Which way the front of furniture faces, whatever stands open before it."""

import numpy as np
import pytest

from manipose_mj.control.furniture.fit.object_frame import object_pose
from manipose_mj.control.furniture.sensing.part_sensing import SensedFurniture
from tests.control.furniture.synthetic import HALF, HEIGHT, body, cloud, door, rectangle

X, Y, Z = np.eye(3)


def _sensed(off: float) -> SensedFurniture:
    """A front that is taken to face elsewhere [deg]."""
    turn = np.radians(off)
    return SensedFurniture(np.array([np.cos(turn), np.sin(turn), 0.0]), ())


@pytest.mark.parametrize("off", [-20.0, -8.0, 8.0, 20.0])
@pytest.mark.parametrize("opening", [0.8, 1.2])
def test_a_front_that_was_missed_by_an_open_door_is_square_to_the_walls(off, opening):
    seen = cloud(body() + door(-HALF, opening, "outer inner"))
    pose = object_pose(seen, _sensed(off))
    assert pose[:3, 0] @ X > np.cos(np.radians(0.5))
    np.testing.assert_allclose(pose[:3, 2], Z)


def test_a_front_alone_changes_nothing():
    # Nothing that is across tells the front from a door that stands open.
    seen = cloud([rectangle(np.array([0.2, -HALF, 0.0]), 2 * HALF * Y, HEIGHT * Z, X)])
    sensed = _sensed(12.0)
    np.testing.assert_allclose(object_pose(seen, sensed)[:3, 0], sensed.front)
