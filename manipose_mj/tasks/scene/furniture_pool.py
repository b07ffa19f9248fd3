"""Articulated objects of which an episode uses some: the others wait high above."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError
from manipose_mj.mjcf.objects import ArticulatedObject

# Furniture that an episode does not use waits up here, apart from parked objects [m].
_PARKED = np.array([0.0, 8.0, 60.0])
_PARKING_STEP = np.array([3.0, 0.0, 0.0])
# By how much the plinth stays behind the front, where doors swing and handles are [m].
_PLINTH_INSET = 0.09
_PLINTH = "plinth"
# It goes through the table and the floor, which hide what is too long of it [m].
_PLINTH_DEPTH = 2.0
_AWAY = np.array([0.0, 0.0, -30.0])  # of a plinth that is not used
_PLINTH_COLOUR = (0.80, 0.79, 0.77, 1.0)


class FurniturePool:
    """The articulated objects of a scene.

    Attributes:
      entities: All of them, `furniture_0`, `furniture_1` and so on; a single one is `cabinet` or
        whatever its category is.
    """

    def __init__(self, assets: Sequence[Asset], arena: composer.Arena) -> None:
        """Attach an entity for each asset.

        Args:
          assets: Articulated ones.
          arena: Not compiled yet.

        Raises:
          InputError: There is none, or one of them is rigid.
        """
        if not assets:
            raise InputError("a task with furniture takes at least one articulated asset; got none")
        self.entities = tuple(
            ArticulatedObject(asset, name=f"furniture_{i}" if len(assets) > 1 else asset.category)
            for i, asset in enumerate(assets)
        )
        for index, entity in enumerate(self.entities):
            _add_plinth(entity)
            arena.attach(entity).pos = _PARKED + index * _PARKING_STEP

    def park(self, physics: mjcf.Physics) -> None:
        """Put all of them away, with their parts shut."""
        for index, entity in enumerate(self.entities):
            position = _PARKED + index * _PARKING_STEP
            self.place(physics, index, position, np.array([1.0, 0.0, 0.0, 0.0]))
            for part in entity.asset.parts:
                joint = physics.bind(entity.joint(part.name))
                joint.qpos, joint.qvel = part.joint.range[0], 0.0

    def place(
        self,
        physics: mjcf.Physics,
        index: int,
        position: Float[np.ndarray, "3"],
        quaternion: Float[np.ndarray, "4"],
        *,
        raised: bool = False,
    ) -> None:
        """Stand one of them somewhere: position [m], `wxyz` quaternion; raised: on its plinth."""
        model = self.entities[index].mjcf_model
        frame = physics.bind(mjcf.get_attachment_frame(model))
        frame.pos, frame.quat = position, quaternion
        physics.bind(model.find("body", _PLINTH)).pos = np.zeros(3) if raised else _AWAY

    def open(self, physics: mjcf.Physics, index: int, part: str, opening: float) -> None:
        """Set the joint of a part [m or rad]."""
        physics.bind(self.entities[index].joint(part)).qpos = opening


def box_of(asset: Asset) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Low and high corner of the whole asset with its parts shut, in the object frame [m]."""
    half = np.abs(asset.label.rotation) @ asset.label.extents / 2
    return asset.label.origin - half, asset.label.origin + half


def _add_plinth(entity: ArticulatedObject) -> None:
    low, high = box_of(entity.asset)
    low = low + [_PLINTH_INSET, 0.01, 0.0]
    high = high - [0.01, 0.01, 0.0]
    body = entity.mjcf_model.worldbody.add("body", name=_PLINTH, pos=_AWAY)
    body.add(
        "geom", name=_PLINTH, type="box", rgba=_PLINTH_COLOUR,
        pos=[*((low + high) / 2)[:2], low[2] - _PLINTH_DEPTH / 2],
        size=[*((high - low) / 2)[:2], _PLINTH_DEPTH / 2],
    )  # fmt: skip
