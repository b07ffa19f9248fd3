"""What tasks with furniture share: the part that each piece is about, and where a piece stands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.mjcf.objects import ArticulatedObject
from manipose_mj.tasks.articulated.placement import Standing, draw_place, widest_start
from manipose_mj.tasks.core.scene import Scene
from manipose_mj.tasks.core.start import Mount, PlacedFurniture
from manipose_mj.tasks.observations.frames import BodyFrame, part_frames


class FurnitureInQuestion:
    """The articulated objects of a scene, each with the part that the task is about.

    Attributes:
      entities: All of them.
      parts: The part in question of each.
    """

    def __init__(
        self,
        scene: Scene,
        assets: Sequence[Asset],
        parts: Sequence[MovingPart],
        standing: Standing,
    ) -> None:
        """Add furniture to a scene.

        Args:
          scene: Has none yet.
          assets: Of which an episode uses one.
          parts: The part in question of each, with a handle.
          standing: Where a piece stands.

        Raises:
          InputError: There is no asset, or one of them is rigid.
        """
        self.standing = standing
        self.parts = tuple(parts)
        self.entities: tuple[ArticulatedObject, ...] = scene.add_furniture(assets).entities

    def sample(
        self, rng: np.random.RandomState, index: int, fraction: float = 0.0
    ) -> tuple[PlacedFurniture, Mount]:
        """Draw where a piece stands so that the arm can use its part, and what the robot stands on.

        Args:
          rng: Draws.
          index: Of the piece.
          fraction: By how much of its range the part is open; 0 where it is to be opened. A door that could
            not be shut from where it folds back to is open by that share of what it can be shut from.
        """
        part, asset = self.parts[index], self.entities[index].asset
        if fraction > 0:
            fraction *= widest_start(asset, part, self.standing)
        place = draw_place(rng, asset, part, fraction, self.standing)
        low, high = part.joint.range
        placed = PlacedFurniture(
            index,
            position=place.position,
            quaternion=np.array([np.cos(place.yaw / 2), 0.0, 0.0, np.sin(place.yaw / 2)]),
            openings={part.name: low + fraction * (high - low)},
            raised=place.raised,
        )
        return placed, place.mount

    def frames(self, index: int) -> dict[str, BodyFrame]:
        """`handle`, `joint` and, in hollow ones, `cavity` of the part in question."""
        return part_frames(self.entities[index], self.parts[index])

    def opening(self, physics: mjcf.Physics, index: int) -> Float[np.ndarray, "1"]:
        """Position of the joint in question [m or rad]."""
        return np.array([self.entities[index].opening(physics, self.parts[index].name)])

    def cavity_pose(self, physics: mjcf.Physics, index: int) -> Float[np.ndarray, "4 4"]:
        """`T_world_cavity` of the part in question."""
        return self.entities[index].cavity_pose(physics, self.parts[index].name)
