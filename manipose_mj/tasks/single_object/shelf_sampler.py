"""Draws a start and a goal at a shelf that some grasp of the object may serve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.poses import compose, invert
from manipose_mj.tasks.core.start import NoStartError
from manipose_mj.tasks.single_object.grasp_room import above_floor, grasps_with_room
from manipose_mj.tasks.single_object.shelf_places import ShelfPlaces, Zone

ZONES: tuple[Zone, ...] = ("table", "by", "under", "in")
_ENOUGH = 4  # grasps with room at start and goal
_MAX_DRAWS = 400
_TURNS = 8  # of an axis of symmetry that are looked at


@dataclass(frozen=True)
class _Stand:
    """How an object stands at a shelf: zone, `T_world_object`."""

    zone: Zone
    pose: Float[np.ndarray, "4 4"]


@dataclass(frozen=True)
class ShelfSampler:
    """Attributes: places; starts, goals: zones of them to draw from; min_distance [m] between."""

    places: ShelfPlaces
    starts: tuple[Zone, ...]
    goals: tuple[Zone, ...]
    min_distance: float

    def __post_init__(self) -> None:
        for zone in (*self.starts, *self.goals):
            if zone not in ZONES:
                raise unknown_name("zone", zone, ZONES)
            if zone == "in" and len(self.places.shelf.boards) < 2:
                raise InputError("zone 'in' lies between two boards; the shelf has one")

    def draw(
        self,
        asset: Asset,
        pairs: Sequence[tuple[int, int]],
        shelf_pose: Float[np.ndarray, "4 4"],
        random_state: np.random.RandomState,
    ) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "4 4"]]:
        """`T_world_object` at the start and at the goal.

        Where no pair of poses with enough grasps turns up, the best of those drawn.

        Raises:
          NoStartError: The object fits the zones in none of its stable poses, or no grasp serves.
        """
        best, most = None, 0
        for _ in range(_MAX_DRAWS):
            start_zone = self.starts[random_state.randint(len(self.starts))]
            goal_zone = self.goals[random_state.randint(len(self.goals))]
            start, goal = pairs[random_state.randint(len(pairs))]
            start_pose = self.places.draw(start_zone, asset, start, shelf_pose, random_state)
            goal_pose = self.places.draw(goal_zone, asset, goal, shelf_pose, random_state)
            if start_pose is None or goal_pose is None:
                continue
            if np.linalg.norm((start_pose - goal_pose)[:3, 3]) < self.min_distance:
                continue
            serving = self._with_room(asset, _Stand(start_zone, start_pose), shelf_pose)
            if serving.sum() > most:
                at_goal = _Stand(goal_zone, goal_pose)
                serving &= self._with_room_at_goal(asset, at_goal, shelf_pose)
            if serving.sum() > most:
                best, most = (start_pose, goal_pose), int(serving.sum())
            if most >= _ENOUGH:
                break
        if best is None:
            raise NoStartError(
                f"{asset.place}: fits the shelf in no stable pose in which a hand can take it "
                "at the start and let it go at the goal"
            )
        return best

    def _with_room(
        self, asset: Asset, stand: _Stand, shelf_pose: Float[np.ndarray, "4 4"]
    ) -> Bool[np.ndarray, "n"]:
        """Which of the asset's grasps have room there."""
        assert asset.grasps is not None
        level = self.places.level(stand.zone)
        floor = 0.0 if level is None else self.places.shelf.levels[level][0]
        tcp_poses = stand.pose @ asset.grasps.poses
        mask = above_floor(tcp_poses, asset.grasps.widths, floor)
        mask[mask] = grasps_with_room(tcp_poses[mask], shelf_pose, self.places.shelf, level)
        return mask

    def _with_room_at_goal(
        self, asset: Asset, stand: _Stand, shelf_pose: Float[np.ndarray, "4 4"]
    ) -> Bool[np.ndarray, "n"]:
        """As at the start, in any of the poses that symmetry makes equal."""
        label = asset.label
        found = np.zeros(len(asset.grasps or ()), bool)
        for turn in label.symmetry.sampled(_TURNS):
            equal = label.pose @ compose(turn, np.zeros(3)) @ invert(label.pose)
            found |= self._with_room(asset, replace(stand, pose=stand.pose @ equal), shelf_pose)
        return found
