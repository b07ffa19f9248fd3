"""What tasks with furniture share: the part that each piece is about, and where a piece stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.mjcf.objects import ArticulatedObject
from manipose_mj.poses import rotation_about
from manipose_mj.tasks.articulated.part_choice import kind_of
from manipose_mj.tasks.core.scene import Scene
from manipose_mj.tasks.core.start import PlacedFurniture
from manipose_mj.tasks.observations.frames import BodyFrame, part_frames

_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Standing:
    """Where furniture stands.

    Attributes:
      x, y: Where the handle of the part in question is while that is shut, in the world [m]; y is
        mirrored for doors hinged on the right.
      yaw: Largest turn either way [rad].
      plinth: Height of the plinth under the furniture [m].
    """

    x: tuple[float, float] = (0.73, 0.77)
    y: tuple[float, float] = (0.05, 0.15)
    yaw: float = radians(6)
    plinth: float = 0.0


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
        self.entities: tuple[ArticulatedObject, ...] = scene.add_furniture(
            assets, plinth=standing.plinth
        ).entities

    def sample(
        self, rng: np.random.RandomState, index: int, fraction: float = 0.0
    ) -> PlacedFurniture:
        """Draw where a piece stands on the table, with the part in question open by `fraction`."""
        part, standing = self.parts[index], self.standing
        assert part.handle is not None
        yaw = rng.uniform(-standing.yaw, standing.yaw)
        handle_xy = (rotation_about(_UP, yaw) @ part.handle.origin)[:2]
        place = np.array([rng.uniform(*standing.x), rng.uniform(*standing.y)])
        place[1] *= side(part)
        low, high = part.joint.range
        return PlacedFurniture(
            index,
            position=np.array([*(place - handle_xy), standing.plinth]),
            quaternion=np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]),
            openings={part.name: low + fraction * (high - low)},
        )

    def frames(self, index: int) -> dict[str, BodyFrame]:
        """`handle`, `joint` and, in hollow ones, `cavity` of the part in question."""
        return part_frames(self.entities[index], self.parts[index])

    def opening(self, physics: mjcf.Physics, index: int) -> Float[np.ndarray, "1"]:
        """Position of the joint in question [m or rad]."""
        return np.array([self.entities[index].opening(physics, self.parts[index].name)])

    def cavity_pose(self, physics: mjcf.Physics, index: int) -> Float[np.ndarray, "4 4"]:
        """`T_world_cavity` of the part in question."""
        return self.entities[index].cavity_pose(physics, self.parts[index].name)


def side(part: MovingPart) -> float:
    """-1 for a door hinged on the right as seen from the front, which opens to that side; else 1."""
    return -1.0 if kind_of(part) == "door" and part.joint.axis[2] > 0 else 1.0
