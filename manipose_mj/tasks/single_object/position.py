"""Target poses at a shelf: out of it (`single_object/position`) and into it."""

from __future__ import annotations

from dataclasses import dataclass

from manipose_mj.tasks.single_object.shelf_places import ShelfPlaces, Zone
from manipose_mj.tasks.single_object.target_pose import TargetPoseConfig


@dataclass(frozen=True)
class PositionConfig(TargetPoseConfig):
    """`TargetPoseConfig` with a shelf and starts where its boards limit grasp and approach."""

    horizon: float = 60.0
    places: ShelfPlaces | None = ShelfPlaces()
    starts: tuple[Zone, ...] = ("by", "under", "in")
    goals: tuple[Zone, ...] = ("table", "in")


@dataclass(frozen=True)
class IntoShelfConfig(TargetPoseConfig):
    """`TargetPoseConfig` with a shelf: from the open table to a pose in, under or by it."""

    horizon: float = 60.0
    places: ShelfPlaces | None = ShelfPlaces()
    starts: tuple[Zone, ...] = ("table",)
    goals: tuple[Zone, ...] = ("by", "under", "in")
