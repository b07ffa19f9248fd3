"""Walls are told apart by the way they face, whatever else stands before them."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.control.furniture.shapes.walls import squareness, walls_of
from tests.control.furniture.synthetic import HALF, body, cloud, door

ANGLES = np.radians(np.arange(-45.0, 45.0, 0.1))


def _walls(parts):
    seen = cloud(parts)
    rows = np.unique(np.floor(seen.points / 0.02).astype(int), axis=0, return_index=True)[1]
    return walls_of(seen.points[rows, :2], seen.normals[rows, :2])


def test_front_and_sides_and_an_open_door_face_their_own_ways():
    walls = _walls(body() + door(-HALF, 1.2, "outer inner"))
    angles = np.sort([np.degrees(wall.angle) % 180 for wall in walls[:5]])
    off_front = np.abs((angles + 45) % 90 - 45)
    assert (off_front < 1.0).sum() == 3
    assert (off_front > 15).sum() == 2


@pytest.mark.parametrize("opening", [0.6, 1.2, 2.9])
def test_only_the_body_has_walls_across_one_another(opening):
    scores = squareness(_walls(body() + door(-HALF, opening, "outer inner")), ANGLES)
    assert abs(np.degrees(ANGLES[scores.argmax()])) < 0.5


def test_a_door_alone_is_square_to_nothing():
    scores = squareness(_walls(door(-HALF, 1.2, "outer inner")), ANGLES)
    assert scores.max() < 1.0


def test_few_points_are_no_wall():
    assert walls_of(np.zeros((10, 2)), np.tile([1.0, 0.0], (10, 1))) == []
