"""Places by, in and under a shelf: where objects may stand or lie there without touching it."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Literal

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Asset
from manipose_mj.mjcf.shelf import ShelfConfig
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.scene.resting import pose_on_table

# On the open table; on the table next to the shelf; on the table, under the first board; on a board
# that has another above it.
Zone = Literal["table", "by", "under", "in"]
UP = np.array([0.0, 0.0, 1.0])
_GAP = 0.012  # that an object keeps from walls [m]
_HEADROOM = 0.03  # and from the board above, to be lifted at all [m]


@dataclass(frozen=True)
class ShelfPlaces:
    """Where a shelf stands and where objects are at it.

    Attributes:
      shelf: Its sizes.
      distance: Of its front's middle from the robot's axis [m].
      azimuth: Of that middle, either way [rad].
      yaw: It faces the robot but for so much, either way [rad].
      deepest: How far behind the front an object's middle may be [m].
      by: Gap between the shelf and what stands by it [m].
      table_distance: Of objects on the open table from the robot's axis [m].
      table_azimuth: Of those, either way [rad].
    """

    shelf: ShelfConfig = ShelfConfig()
    distance: tuple[float, float] = (0.56, 0.60)
    azimuth: float = radians(25)
    yaw: float = radians(10)
    deepest: float = 0.17
    by: tuple[float, float] = (0.02, 0.08)
    table_distance: tuple[float, float] = (0.36, 0.62)
    table_azimuth: float = radians(75)

    def draw_shelf(self, random_state: np.random.RandomState) -> Float[np.ndarray, "4 4"]:
        """`T_world_shelf`."""
        distance = random_state.uniform(*self.distance)
        azimuth = random_state.uniform(-self.azimuth, self.azimuth)
        yaw = azimuth + random_state.uniform(-self.yaw, self.yaw)
        place = distance * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        return compose(rotation_about(UP, yaw), place)

    def draw(
        self,
        zone: Zone,
        asset: Asset,
        stable: int,
        shelf_pose: Float[np.ndarray, "4 4"],
        random_state: np.random.RandomState,
    ) -> Float[np.ndarray, "4 4"] | None:
        """`T_world_object` in a zone, in a stable pose; None where it does not fit as drawn."""
        yaw = random_state.uniform(-np.pi, np.pi)
        u, v = random_state.uniform(size=2)
        origin = pose_on_table(asset, stable, np.zeros(2), yaw)
        rotation = origin[:3, :3] @ asset.label.rotation
        half = _half_lengths(shelf_pose[:3, :3].T @ rotation, asset)
        if zone == "table":
            xy, floor = self._on_table(u, v, half, shelf_pose), 0.0
        elif zone == "by":
            xy, floor = self._by(u, v, half, shelf_pose), 0.0
        else:
            level = self.level(zone)
            assert level is not None
            floor, height = self.shelf.levels[level]
            xy = self._on_board(u, v, half, shelf_pose)
            if 2 * half[2] + _HEADROOM > height:
                return None
        if xy is None:
            return None
        # What is placed is the middle; the label's origin of a tool lies beside it.
        return pose_on_table(asset, stable, xy - (rotation @ asset.label.center)[:2], yaw, floor)

    def level(self, zone: Zone) -> int | None:
        """Which of the shelf's levels a zone is; None outside."""
        return {"under": 0, "in": 1}.get(zone)

    def _on_board(
        self, u: float, v: float, half: np.ndarray, shelf_pose: np.ndarray
    ) -> Float[np.ndarray, "2"] | None:
        shelf = self.shelf
        low, high = half[0] + _GAP, min(shelf.depth - half[0] - _GAP, self.deepest)
        side = shelf.width / 2 - shelf.thickness - half[1] - _GAP
        if high < low or side < 0:
            return None
        return _in_world(shelf_pose, low + u * (high - low), (2 * v - 1) * side)

    def _by(
        self, u: float, v: float, half: np.ndarray, shelf_pose: np.ndarray
    ) -> Float[np.ndarray, "2"] | None:
        shelf = self.shelf
        gap = self.by[0] + u * (self.by[1] - self.by[0])
        # A third each: in front, on the left, on the right.
        along, where = (3 * v) % 1.0, int(3 * v)
        if where == 0:
            place = (-gap - half[0], (2 * along - 1) * shelf.width / 2)
        else:
            sign = 1.0 if where == 1 else -1.0
            place = (along * shelf.depth, sign * (shelf.width / 2 + gap + half[1]))
        xy = _in_world(shelf_pose, *place)
        return xy if self._within_reach(xy) else None

    def _on_table(
        self, u: float, v: float, half: np.ndarray, shelf_pose: np.ndarray
    ) -> Float[np.ndarray, "2"] | None:
        distance = self.table_distance[0] + u * (self.table_distance[1] - self.table_distance[0])
        azimuth = (2 * v - 1) * self.table_azimuth
        xy = distance * np.array([np.cos(azimuth), np.sin(azimuth)])
        x, y = (shelf_pose[:2, :2].T @ (xy - shelf_pose[:2, 3])).tolist()
        # In front of the shelf or beside it, further away than what stands by it.
        beyond = max(-x - half[0], abs(y) - self.shelf.width / 2 - half[1])
        return xy if beyond > self.by[1] and self._within_reach(xy) else None

    def _within_reach(self, xy: np.ndarray) -> bool:
        distance = float(np.linalg.norm(xy))
        return self.table_distance[0] <= distance <= self.table_distance[1] + 0.08


def _in_world(shelf_pose: np.ndarray, x: float, y: float) -> Float[np.ndarray, "2"]:
    return (shelf_pose @ np.array([x, y, 0.0, 1.0]))[:2]


def _half_lengths(rotation: Float[np.ndarray, "3 3"], asset: Asset) -> Float[np.ndarray, "3"]:
    """Of the bounding box along the axes in which the label is turned so [m]."""
    return np.abs(rotation) @ asset.label.extents / 2
