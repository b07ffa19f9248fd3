"""Collision-free joint motions: RRT-Connect (Kuffner and LaValle 2000) and shortcutting.

Small enough to own: planners on PyPI stop on wall time, which would make episodes depend on how
busy the machine is; this one stops on a count, so the same seed gives the same path.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS

Collides = Callable[[np.ndarray], bool]
_LOW, _HIGH = POSITION_LIMITS.T


@dataclass(frozen=True)
class FreeMotionConfig:
    """Attributes: step: between nodes of a tree [rad]; resolution: between collision checks, in
    any joint [rad]; max_nodes: before giving up; shortcuts: tried on a found path."""

    step: float = 0.35
    resolution: float = 0.025
    max_nodes: int = 1500
    shortcuts: int = 80


def plan_path(
    start: Float[np.ndarray, "7"],
    goal: Float[np.ndarray, "7"],
    collides: Collides,
    rng: np.random.Generator,
    config: FreeMotionConfig | None = None,
) -> Float[np.ndarray, "n 7"] | None:
    """Way points from start to goal, free of collision in between; None if none was found.

    Args:
      start: Joint angles [rad]; assumed free.
      goal: Joint angles [rad].
      collides: Whether a configuration collides.
      rng: Where samples come from.
      config: Steps and effort.
    """
    config = config or FreeMotionConfig()
    if collides(goal):
        return None
    if edge_is_free(start, goal, collides, config.resolution):
        return np.stack([start, goal])
    trees = [_Tree(start), _Tree(goal)]
    for count in range(config.max_nodes):
        grow, other = trees[count % 2], trees[1 - count % 2]
        sample = rng.uniform(_LOW, _HIGH)
        if rng.uniform() < 0.5:  # the middle of the range is where the arm works
            sample = 0.5 * (sample + 0.5 * (start + goal))
        reached = _extend(grow, sample, collides, config)
        if reached is None:
            continue
        if _connect(other, grow.nodes[reached], collides, config):
            path = [*grow.path(reached)[::-1], *other.path(len(other.nodes) - 1)[1:]]
            if count % 2:
                path = path[::-1]
            return _shortcut(np.stack(path), collides, rng, config)
    return None


def edge_is_free(
    a: Float[np.ndarray, "7"], b: Float[np.ndarray, "7"], collides: Collides, resolution: float
) -> bool:
    """Whether the straight line from a (exclusive) to b is free, checked coarse to fine."""
    count = max(1, int(np.ceil(np.abs(b - a).max() / resolution)))
    fractions = np.arange(1, count + 1) / count
    # Bit-reversed order finds a collision in the middle of an edge early.
    order = np.argsort([int(f"{i:016b}"[::-1], 2) for i in range(count)], kind="stable")
    return not any(collides(a + f * (b - a)) for f in fractions[order])


class _Tree:
    def __init__(self, root: np.ndarray) -> None:
        self.parents = [-1]
        self._rows = np.empty((256, len(root)))  # nodes, then room for others
        self._rows[0] = root

    @property
    def nodes(self) -> Float[np.ndarray, "n 7"]:
        return self._rows[: len(self.parents)]

    def nearest(self, q: np.ndarray) -> int:
        return int(np.argmin(((self.nodes - q) ** 2).sum(axis=1)))

    def add(self, q: np.ndarray, parent: int) -> int:
        if len(self.parents) == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[len(self.parents)] = q
        self.parents.append(parent)
        return len(self.parents) - 1

    def path(self, index: int) -> list[np.ndarray]:
        """From a node to the root."""
        path = []
        while index >= 0:
            path.append(self.nodes[index])
            index = self.parents[index]
        return path


def _extend(
    tree: _Tree, sample: np.ndarray, collides: Collides, config: FreeMotionConfig
) -> int | None:
    near = tree.nearest(sample)
    delta = sample - tree.nodes[near]
    length = np.linalg.norm(delta)
    if length < 1e-9:
        return None
    q = tree.nodes[near] + delta * min(1.0, config.step / length)
    if not edge_is_free(tree.nodes[near], q, collides, config.resolution):
        return None
    return tree.add(q, near)


def _connect(tree: _Tree, goal: np.ndarray, collides: Collides, config: FreeMotionConfig) -> bool:
    while True:
        reached = _extend(tree, goal, collides, config)
        if reached is None:
            return False
        if np.abs(tree.nodes[reached] - goal).max() < 1e-9:
            return True


def _shortcut(
    path: Float[np.ndarray, "n 7"],
    collides: Collides,
    rng: np.random.Generator,
    config: FreeMotionConfig,
) -> Float[np.ndarray, "m 7"]:
    for _ in range(config.shortcuts):
        if len(path) < 3:
            break
        lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
        ends = np.cumsum(lengths)
        s, t = np.sort(rng.uniform(0, ends[-1], 2))
        i, j = int(np.searchsorted(ends, s)), int(np.searchsorted(ends, t))
        if i == j:
            continue
        a = path[i] + (path[i + 1] - path[i]) * (1 - (ends[i] - s) / lengths[i])
        b = path[j] + (path[j + 1] - path[j]) * (1 - (ends[j] - t) / lengths[j])
        if edge_is_free(a, b, collides, config.resolution):
            path = np.concatenate([path[: i + 1], [a, b], path[j + 1 :]])
    return path
