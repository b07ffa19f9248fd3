"""Doors that stand open turn about where their panels end, wherever their hinges were thought to be."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.control.furniture.shapes.handle_shape import UP_FRONT
from manipose_mj.control.furniture.shapes.open_panel import hinge_of_panel
from manipose_mj.poses import compose, rotation_about, transform
from tests.control.furniture.synthetic import (
    FRONT,
    HALF,
    HEIGHT,
    THICKNESS,
    body,
    cloud,
    door,
    rectangle,
)

X, Y, Z = np.eye(3)
ORIGIN = np.array([FRONT, -HALF, 0.0])


def found(parts, opening, off, agree=0.0):
    """Of a door at -Y that stands open, whose hinge is thought to be `off` along its panel [m]: also that, and the panel's way."""
    turn = rotation_about(-Z, opening)
    shut = np.array([FRONT + 0.05, -0.15 * HALF, 0.25])
    handle = compose(turn @ UP_FRONT, turn @ (shut - ORIGIN) + ORIGIN)
    seen, thought = cloud(parts), ORIGIN + off * (turn @ Y) + 0.2 * Z
    return hinge_of_panel(seen.points, seen.normals, handle, thought, -Z, agree), thought, turn @ Y


@pytest.mark.parametrize("faces", ["outer inner", "outer", "inner"])
@pytest.mark.parametrize("opening", [0.3, 0.8, 1.1])
@pytest.mark.parametrize("off", [-0.15, -0.06, 0.08])
def test_a_hinge_is_moved_to_where_the_panel_ends(faces, opening, off):
    result, thought, panel = found(body() + door(-HALF, opening, faces), opening, off)
    assert result is not None
    hinge, way = result
    assert np.linalg.norm((hinge - ORIGIN)[:2]) < 0.025
    assert hinge[2] == thought[2]
    np.testing.assert_allclose(way, panel, atol=0.02)


def test_a_hinge_that_is_near_stays():
    result, thought, _ = found(body() + door(-HALF, 0.8, "outer inner"), 0.8, 0.05, agree=0.08)
    assert result is not None
    np.testing.assert_array_equal(result[0], thought)


@pytest.mark.parametrize("opening", [0.25, 0.45])
def test_what_is_flush_beside_a_shut_door_is_none_of_it(opening):
    """As the sill below an oven's door: it faces out of the front, where the panel does no more."""
    corner = np.array([FRONT + THICKNESS / 2, -HALF - 0.08, 0.0])
    sill = rectangle(corner, 0.08 * Y, HEIGHT * Z, X)
    (points, normals), *sides = body()
    other = points[:, 1] > 0.0  # half of the front is behind the door
    front = (points[other], normals[other])
    result, _, _ = found([front, *sides, sill, *door(-HALF, opening, "outer")], opening, -0.10)
    assert result is not None
    assert np.linalg.norm((result[0] - ORIGIN)[:2]) < 0.025


def test_a_door_in_line_with_a_side_does_not_go_on_behind_the_front():
    result, _, _ = found(body() + door(-HALF, np.pi / 2, "outer inner"), np.pi / 2, 0.04)
    assert result is not None
    assert abs(result[0][0] - FRONT) < 0.045


def test_a_panel_that_ends_before_the_body_tells_nothing():
    """A curved one, or one whose other half does not show."""
    points, normals = zip(*door(-HALF, 0.8, "outer"), strict=True)
    turn = rotation_about(-Z, 0.8)
    shut = [transform(compose(turn.T, ORIGIN - turn.T @ ORIGIN), p) for p in points]
    keep = [p[:, 1] > -HALF + 0.10 for p in shut]
    half = [(p[k], n[k]) for p, n, k in zip(points, normals, keep, strict=True)]
    assert found([*body(), *half], 0.8, 0.1)[0] is None


def test_without_a_panel_nothing_is_found():
    assert found(body(), 0.8, 0.1)[0] is None
