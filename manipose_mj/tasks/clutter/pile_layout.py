"""What is dropped where and how turned, to make a heap, a stack or a hiding place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError

Layout = Literal["heap", "stack", "cover"]

_SPARE = 2  # objects dropped beyond the least number: some roll away
_LIKED = 3  # objects of which one lies under others
_WALLS_AND_ROOF = 3  # objects laid around a hidden one
_GAP = 0.012  # between it and those beside it [m]
_LEVEL = 0.7  # of an axis of symmetry along the vertical, below which an object may roll
_OFTEN = 0.2  # of the drops that end so


@dataclass(frozen=True)
class PileConfig:
    """How a pile is dropped.

    Attributes:
      layout: `"heap"` drops objects any way up at random places; `"stack"` lays one with a broad side
        flat in the middle, some of the others flat on it and the rest around; `"cover"` lays long
        objects beside and over a small one, and drops the rest anywhere, until it is hidden.
      count: Least and largest number of objects.
      radius: Least and largest distance of the walls from the middle [m].
      spread: What rolls farther from the middle is taken away [m].
      on_top: Least and largest number of objects laid on the first of a stack.
      hidden: From no side is more seen of the first of a `"cover"` than this share.
    """

    layout: Layout = "heap"
    count: tuple[int, int] = (5, 15)
    radius: tuple[float, float] = (0.10, 0.16)
    spread: float = 0.21
    on_top: tuple[int, int] = (1, 2)
    hidden: float = 0.5

    def __post_init__(self) -> None:
        low, high = self.count
        if not 1 <= low <= high:
            raise InputError(f"pile count is {self.count}; expected least <= largest, from 1 on")


@dataclass(frozen=True)
class Drop:
    """Attributes: rotation, `R_world_object`; xy: of the label's middle [m]."""

    rotation: Float[np.ndarray, "3 3"]
    xy: Float[np.ndarray, "2"]


def choose(
    assets: Sequence[Asset], config: PileConfig, rng: np.random.Generator
) -> Int[np.ndarray, "n"]:
    """Which assets are dropped, in order."""
    high = min(config.count[1], len(assets))
    low = min(config.count[0] + _SPARE, high)
    chosen = rng.permutation(len(assets))[: int(rng.integers(low, high + 1))]
    if config.layout == "heap":
        return chosen
    sizes = np.array([np.sort(assets[i].label.extents) for i in chosen])
    if config.layout == "cover":
        liking, next_ones = sizes.prod(axis=1), -sizes[:, 2]
    else:
        liking, next_ones = -sizes[:, 1], -sizes.prod(axis=1)
    first = int(rng.choice(np.argsort(liking, kind="stable")[:_LIKED]))
    others = np.delete(np.arange(len(chosen)), first)
    others = others[np.argsort(next_ones[others], kind="stable")]
    return chosen[np.concatenate([[first], others])]


def rolls(asset: Asset) -> bool:
    """Whether an object often comes to lie on its round side."""
    if not asset.label.symmetry.axial:
        return False
    ups = np.array([abs((p.rotation @ asset.label.rotation)[2, 0]) for p in asset.stable_poses])
    shares = np.array([pose.probability for pose in asset.stable_poses])
    return bool(shares[ups < _LEVEL].sum() > _OFTEN)


def drops(
    objects: Sequence[Asset], config: PileConfig, radius: float, rng: np.random.Generator
) -> Iterator[Drop]:
    """How each of them falls, in order, between walls at this distance from the middle [m]."""
    if config.layout == "cover":
        yield from _hiding(objects[: _WALLS_AND_ROOF + 1], rng)
        rest, near, far = objects[_WALLS_AND_ROOF + 1 :], 0.3 * radius, 0.9 * radius
    elif config.layout == "stack":
        count = 1 + int(rng.integers(config.on_top[0], config.on_top[1] + 1))
        for asset in objects[:count]:
            yield Drop(_flat(asset, rng.uniform(-np.pi, np.pi)), _place(0.0, 0.015, rng))
        rest, near, far = objects[count:], 0.6 * radius, 0.9 * radius
    else:
        rest, near, far = objects, 0.0, 0.6 * radius
    for _ in rest:
        any_way = Rotation.from_quat(rng.normal(size=4)).as_matrix()
        yield Drop(any_way, _place(near, far, rng))


def _hiding(objects: Sequence[Asset], rng: np.random.Generator) -> Iterator[Drop]:
    """One in the middle, one on either side of it, one over them, all along one line."""
    heading = rng.uniform(-np.pi, np.pi)
    across = np.array([-np.sin(heading), np.cos(heading)])
    half = [_width(asset) / 2 for asset in objects]
    beside = [0.0, *(half[0] + _GAP + own for own in half[1:3]), 0.0]
    for asset, side, distance in zip(objects, (0, 1, -1, 0), beside, strict=False):
        yield Drop(_flat(asset, heading + rng.normal(0.0, 0.05)), side * distance * across)


def _place(near: float, far: float, rng: np.random.Generator) -> Float[np.ndarray, "2"]:
    angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(near, far)
    return distance * np.array([np.cos(angle), np.sin(angle)])


def _flat(asset: Asset, heading: float) -> Float[np.ndarray, "3 3"]:
    """`R_world_object` on the broadest side, the longest one along a direction of the plane [rad]."""
    rest = _lowest(asset)
    longest = (rest @ asset.label.rotation)[:2, int(np.argmax(asset.label.extents))]
    yaw = heading - float(np.arctan2(longest[1], longest[0]))
    return Rotation.from_euler("z", yaw).as_matrix() @ rest


def _width(asset: Asset) -> float:
    """Across the longest side, when it lies on the broadest [m]."""
    turned = _flat(asset, 0.0) @ asset.label.rotation
    return float(np.abs(turned[1]) @ asset.label.extents)


def _lowest(asset: Asset) -> Float[np.ndarray, "3 3"]:
    """`R_world_object` of the stable pose with the lowest middle."""
    heights = [(rest.rotation @ asset.label.origin)[2] + rest.height for rest in asset.stable_poses]
    return asset.stable_poses[int(np.argmin(heights))].rotation
