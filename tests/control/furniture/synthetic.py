"""Clouds of furniture made of rectangles: a body, and a door that stands open before it."""

from __future__ import annotations

import numpy as np

from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.poses import compose, rotation_about, transform

FRONT, HALF, HEIGHT, THICKNESS = 0.2, 0.3, 0.5, 0.02
X, Y, Z = np.eye(3)


def rectangle(
    corner: np.ndarray, first: np.ndarray, second: np.ndarray, normal: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Noisy points 6 mm apart, and their normals."""
    steps = [np.arange(0, np.linalg.norm(side), 0.006) for side in (first, second)]
    a, b = (grid.ravel()[:, None] for grid in np.meshgrid(*steps))
    points = corner + a * first / np.linalg.norm(first) + b * second / np.linalg.norm(second)
    points = points + np.random.default_rng(0).normal(0, 0.001, points.shape)
    return points, np.tile(normal, (len(points), 1))


def body() -> list[tuple[np.ndarray, np.ndarray]]:
    """A front, and both sides of the body."""
    low = np.array([-FRONT, -HALF, 0.0])
    depth, width, height = 2 * FRONT * X, 2 * HALF * Y, HEIGHT * Z
    return [
        rectangle(low + depth, width, height, X),
        rectangle(low, depth, height, -Y),
        rectangle(low + width, depth, height, Y),
    ]


def door(hinge: float, opening: float, faces: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Before the front, at a side of the body, with a handle at its free edge; shut, it would cover half of it."""
    inwards = -np.sign(hinge)
    origin = np.array([FRONT, hinge, 0.0])
    turn = rotation_about(-inwards * Z, opening)
    motion = compose(turn, origin - turn @ origin)
    width = inwards * HALF * Y
    outer = origin + THICKNESS * X
    parts = []
    if "outer" in faces:
        parts.append(rectangle(outer, width, HEIGHT * Z, X))
        bar = outer + 0.85 * width + [0.03, 0.0, 0.2]
        parts.append(rectangle(bar, 0.012 * Y, 0.1 * Z, X))
    if "inner" in faces:
        parts.append(rectangle(origin, width, HEIGHT * Z, -X))
    return [(transform(motion, points), normals @ turn.T) for points, normals in parts]


def cloud(parts: list[tuple[np.ndarray, np.ndarray]]) -> SceneCloud:
    points, normals = (np.concatenate(each) for each in zip(*parts, strict=True))
    return SceneCloud(points, normals, np.ones(len(points), int))
