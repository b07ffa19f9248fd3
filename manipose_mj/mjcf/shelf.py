"""A shelf of boards between two side walls, open towards the robot: it limits grasps and approaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from manipose_mj.assets.physics import (
    SCENE_CONTACT_TIME,
    SOLIMP,
    SUPPORT_CONDIM,
    SUPPORT_FRICTION,
)
from manipose_mj.errors import InputError
from manipose_mj.poses import pose_to_vector, vector_to_pose

# Enough for the hand, 20 cm across its fingers and 11 cm from palm to fingertips, to enter lying.
MIN_GAP = 0.15
_BOARD = [0.80, 0.66, 0.46, 1]
_WALL = [0.72, 0.57, 0.38, 1]
_BACK = [0.55, 0.42, 0.28, 1]
_BACK_THICKNESS = 0.008


@dataclass(frozen=True)
class ShelfConfig:
    """Sizes in metres. The table is the floor of the lowest compartment: what stands there is under
    the shelf's first board.

    Attributes:
      width: Outside, from wall to wall.
      depth: From the open front to the back.
      boards: Heights of the boards' upper sides, from the lowest; the last one is the roof.
      thickness: Of boards and walls.
      back: Whether a panel closes the back.
    """

    width: float = 0.72
    depth: float = 0.27
    boards: tuple[float, ...] = (0.33, 0.66)
    thickness: float = 0.018
    back: bool = False

    def __post_init__(self) -> None:
        if not self.boards or self.width <= 2 * self.thickness or self.depth <= _BACK_THICKNESS:
            raise InputError(f"{self}: a shelf needs a board, width and depth")
        gaps = np.diff([0.0, *self.boards]) - self.thickness
        if gaps.min() < MIN_GAP:
            raise InputError(
                f"{self}: {gaps.min():.3f} m between two boards; the hand needs {MIN_GAP} m"
            )

    @property
    def levels(self) -> tuple[tuple[float, float], ...]:
        """Floor and free height [m] of what is under the first board, of each board, of the roof."""
        floors = (0.0, *self.boards)
        heights = [b - a - self.thickness for a, b in zip(floors, self.boards, strict=False)]
        return tuple(zip(floors, (*heights, np.inf), strict=True))


class Shelf(composer.Entity):
    """A static shelf, to be attached with `arena.attach`.

    Its frame lies on the table in the middle of the open front: x from front to back, z up.
    """

    def _build(self, config: ShelfConfig | None = None, name: str = "shelf") -> None:
        self.config = config or ShelfConfig()
        self._mjcf_root = mjcf.RootElement(model=name)
        self._body = self._mjcf_root.worldbody.add("body", name="shelf")
        width, depth, thickness = self.config.width, self.config.depth, self.config.thickness
        height = self.config.boards[-1]
        inside = width / 2 - thickness
        for side, y in (("left", inside), ("right", -width / 2)):
            self._add(f"{side}_wall", (0.0, y, 0.0), (depth, y + thickness, height), _WALL)
        for i, top in enumerate(self.config.boards):
            self._add(f"board_{i}", (0.0, -inside, top - thickness), (depth, inside, top), _BOARD)
        if self.config.back:
            behind = depth + _BACK_THICKNESS
            self._add("back", (depth, -width / 2, 0.0), (behind, width / 2, height), _BACK)

    def _add(
        self,
        name: str,
        low: tuple[float, float, float],
        high: tuple[float, float, float],
        rgba: list[float],
    ) -> None:
        low_corner, high_corner = np.array(low), np.array(high)
        # Contacts as the table's: things rest on boards as they rest there.
        self._body.add(
            "geom", name=name, type="box", size=(high_corner - low_corner) / 2,
            pos=(high_corner + low_corner) / 2, rgba=rgba, friction=SUPPORT_FRICTION, condim=SUPPORT_CONDIM,
            solref=[SCENE_CONTACT_TIME, 1], solimp=SOLIMP,
        )  # fmt: skip

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """The shelf's MJCF."""
        return self._mjcf_root

    @property
    def boxes(self) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
        """Centres and half lengths of its boxes, in the shelf's frame [m]."""
        geoms = self._mjcf_root.find_all("geom")
        return np.stack([g.pos for g in geoms]), np.stack([g.size for g in geoms])

    def place(self, physics: mjcf.Physics, pose: Float[np.ndarray, "4 4"]) -> None:
        """Stand it at `T_world_shelf`."""
        vector = pose_to_vector(pose)
        frame = physics.bind(mjcf.get_attachment_frame(self._mjcf_root))
        frame.pos, frame.quat = vector[:3], vector[3:]

    def pose(self, physics: mjcf.Physics) -> Float[np.ndarray, "4 4"]:
        """`T_world_shelf`."""
        frame = physics.bind(mjcf.get_attachment_frame(self._mjcf_root))
        return vector_to_pose(np.concatenate([frame.pos, frame.quat]))
