"""What tasks with furniture share: some pieces of which an episode uses one, and where it stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from asset_pipeline.assets import Asset, MovingPart
from manipose_mj.errors import InputError
from manipose_mj.mjcf.objects import ArticulatedObject
from manipose_mj.poses import rotation_about
from manipose_mj.tasks.part_choice import PartChoice, choose_part, kind_of
from manipose_mj.tasks.posed_things import Carried, part_things

# Furniture that an episode does not use waits up here, apart from parked objects [m].
_PARKED = np.array([0.0, 8.0, 60.0])
_PARKING_STEP = np.array([3.0, 0.0, 0.0])
# By how much the plinth stays behind the front, where doors swing and handles are [m].
_PLINTH_INSET = 0.09
_PLINTH_COLOUR = (0.80, 0.79, 0.77, 1.0)
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


class FurniturePool:
    """The pieces of furniture of a task, each with the part that the task is about.

    Attributes:
      entities: All of them, `furniture_0`, `furniture_1` and so on; a single one is `cabinet` or
        whatever its category is.
      parts: The part in question of each.
    """

    def __init__(
        self,
        assets: Sequence[Asset],
        choice: PartChoice,
        standing: Standing,
        arena: composer.Arena,
        *,
        hollow: bool,
    ) -> None:
        """Attach an entity for each asset.

        Raises:
          InputError: There is none, or one of them has no such part.
        """
        if not assets:
            raise InputError("a task with furniture takes at least one articulated asset; got none")
        self.standing = standing
        self.parts = tuple(choose_part(asset, choice, hollow=hollow) for asset in assets)
        self.entities = tuple(
            ArticulatedObject(asset, name=f"furniture_{i}" if len(assets) > 1 else asset.category)
            for i, asset in enumerate(assets)
        )
        for index, entity in enumerate(self.entities):
            if standing.plinth:
                _add_plinth(entity, standing.plinth)
            arena.attach(entity).pos = _PARKED + index * _PARKING_STEP

    def place(
        self,
        physics: mjcf.Physics,
        random_state: np.random.RandomState,
        index: int,
        fraction: float = 0.0,
    ) -> None:
        """Stand one of them on the table, the part in question open by `fraction`, and park the rest."""
        for i, entity in enumerate(self.entities):
            frame = physics.bind(mjcf.get_attachment_frame(entity.mjcf_model))
            frame.pos, frame.quat = _PARKED + i * _PARKING_STEP, [1.0, 0.0, 0.0, 0.0]
            for part in entity.asset.parts:
                joint = physics.bind(entity.joint(part.name))
                joint.qpos, joint.qvel = part.joint.range[0], 0.0
        entity, part, standing = self.entities[index], self.parts[index], self.standing
        assert part.handle is not None
        yaw = random_state.uniform(-standing.yaw, standing.yaw)
        handle_xy = (rotation_about(_UP, yaw) @ part.handle.origin)[:2]
        place = np.array([random_state.uniform(*standing.x), random_state.uniform(*standing.y)])
        place[1] *= side(part)
        frame = physics.bind(mjcf.get_attachment_frame(entity.mjcf_model))
        frame.pos = [*(place - handle_xy), standing.plinth]
        frame.quat = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        low, high = part.joint.range
        physics.bind(entity.joint(part.name)).qpos = low + fraction * (high - low)

    def landmarks(self, index: int) -> dict[str, Carried]:
        """`handle`, `joint` and, in hollow ones, `cavity` of the part in question."""
        return part_things(self.entities[index], self.parts[index])

    def opening(self, physics: mjcf.Physics, index: int) -> Float[np.ndarray, "1"]:
        """Position of the joint in question [m or rad]."""
        return np.array([self.entities[index].opening(physics, self.parts[index].name)])

    def cavity_pose(self, physics: mjcf.Physics, index: int) -> Float[np.ndarray, "4 4"]:
        """`T_world_cavity` of the part in question."""
        return self.entities[index].cavity_pose(physics, self.parts[index].name)


def side(part: MovingPart) -> float:
    """-1 for a door hinged on the right as seen from the front, which opens to that side; else 1."""
    return -1.0 if kind_of(part) == "door" and part.joint.axis[2] > 0 else 1.0


def box_of(asset: Asset) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Low and high corner of the whole asset with its parts shut, in the object frame [m]."""
    half = np.abs(asset.label.rotation) @ asset.label.extents / 2
    return asset.label.origin - half, asset.label.origin + half


def _add_plinth(entity: ArticulatedObject, height: float) -> None:
    low, high = box_of(entity.asset)
    low = low + [_PLINTH_INSET, 0.01, 0.0]
    high = high - [0.01, 0.01, 0.0]
    entity.mjcf_model.worldbody.add(
        "geom", name="plinth", type="box", rgba=_PLINTH_COLOUR,
        pos=[*((low + high) / 2)[:2], -height / 2], size=[*((high - low) / 2)[:2], height / 2],
    )  # fmt: skip


def split_objects(
    objects: tuple[Asset, ...] | None, furniture: tuple[Asset, ...], things: tuple[Asset, ...]
) -> tuple[tuple[Asset, ...], tuple[Asset, ...]]:
    """A user's objects as furniture and things, the built-in ones where he names none of a kind."""
    own = objects or ()
    return (
        tuple(asset for asset in own if asset.kind == "articulated") or furniture,
        tuple(asset for asset in own if asset.kind == "rigid") or things,
    )
