"""Boxes with holes, boxes around points, level surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.control.furniture.shapes.boxes import voxel_boxes, without
from manipose_mj.control.furniture.surroundings import surrounding_boxes

UNIT = np.array([[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]])


def volume(boxes: np.ndarray) -> float:
    return float(np.prod(boxes[:, 1] - boxes[:, 0], axis=1).sum())


def inside(boxes: np.ndarray, point: list[float]) -> bool:
    return bool(((boxes[:, 0] < point) & (boxes[:, 1] > point)).all(axis=1).any())


def test_a_hole_is_empty_and_all_else_is_left():
    left = without(UNIT, np.array([[0.25, 0.25, 0.25], [2.0, 0.75, 0.75]]))
    assert volume(left) == pytest.approx(1 - 0.75 * 0.25)
    assert not inside(left, [0.5, 0.5, 0.5]) and inside(left, [0.1, 0.5, 0.5])


def test_a_hole_elsewhere_changes_nothing():
    np.testing.assert_array_equal(without(UNIT, UNIT[0] + 3.0), UNIT)


def test_voxels_that_go_on_are_one_box():
    grid = np.stack(np.meshgrid(*[np.arange(0.005, 0.1, 0.005)] * 3), axis=-1).reshape(-1, 3)
    boxes = voxel_boxes(grid, 0.02, 3)
    assert len(boxes) == 1
    np.testing.assert_allclose(boxes[0], [[0, 0, 0], [0.1, 0.1, 0.1]], atol=1e-9)
    assert len(voxel_boxes(grid[:2], 0.02, 3)) == 0


def level(low: tuple[float, float], high: tuple[float, float], height: float) -> np.ndarray:
    """Noisy points of a level rectangle."""
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(*[np.arange(a, b, 0.006) for a, b in zip(low, high, strict=True)])
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, height)], axis=1)
    return points + rng.normal(0, [0, 0, 0.002], points.shape)


def test_a_table_and_a_board_become_slabs_of_their_heights():
    points = np.concatenate(
        [level((0.2, -0.6), (1.2, 0.6), 0.0), level((0.6, -0.3), (0.9, 0.3), 0.33)]
    )
    boxes = surrounding_boxes(points)
    tops = sorted({round(float(box[1, 2]), 3) for box in boxes})
    np.testing.assert_allclose(tops, [0.0, 0.33], atol=0.002)
    board = boxes[boxes[:, 1, 2] > 0.2][0]
    np.testing.assert_allclose(board[:, :2], [[0.6, -0.3], [0.9, 0.3]], atol=0.01)


def test_a_wall_is_kept_clear_of():
    rng = np.random.default_rng(0)
    wall = rng.uniform([0.5, 0.3, 0.1], [0.9, 0.302, 0.6], (6000, 3))
    boxes = surrounding_boxes(np.concatenate([level((0.2, -0.6), (1.2, 0.6), 0.0), wall]))
    assert inside(boxes, [0.7, 0.301, 0.35]) and not inside(boxes, [0.7, 0.2, 0.35])
