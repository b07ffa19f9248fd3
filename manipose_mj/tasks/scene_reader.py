"""Reads the state of a scene from the simulator, through indices looked up once per compiled model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from dm_control import mjcf
from jaxtyping import Float, Int

from asset_pipeline.assets import MovingPart
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.mjcf.panda import Panda
from manipose_mj.poses import compose
from manipose_mj.tasks.scene_state import ObjectState, PartState, SceneState

# Who a geom belongs to, in contacts.
_ROBOT, _LEFT_PAD, _RIGHT_PAD, _NOBODY, _FIRST = 0, 1, 2, 3, 4


@dataclass(frozen=True)
class _Object:
    entity: RigidObject
    owner: int
    body: int
    velocity: int
    label: Float[np.ndarray, "4 4"]


@dataclass(frozen=True)
class _Part:
    furniture: ArticulatedObject
    part: MovingPart
    owner: int
    body: int
    base: int
    position: int
    handle: Float[np.ndarray, "4 4"]
    cavity: Float[np.ndarray, "4 4"]


class SceneReader:
    """What `SceneState` is made of, for one compiled model."""

    def __init__(
        self,
        physics: mjcf.Physics,
        robot: Panda,
        objects: Sequence[RigidObject],
        furnishings: Sequence[ArticulatedObject],
    ) -> None:
        """Look up what the objects and parts that may be in play are called in the model."""
        self._model = physics.model.ptr
        self._site = int(physics.bind(robot.tcp_site).element_id)
        self._fingers = [int(physics.bind(j).qposadr) for j in robot.finger_joints]
        self._owners = np.full(physics.model.ngeom, _NOBODY)
        self._owners[_geoms(physics, robot.mjcf_model)] = _ROBOT
        left, right = physics.bind(robot.pad_geoms).element_id
        self._owners[left], self._owners[right] = _LEFT_PAD, _RIGHT_PAD
        self._objects: dict[RigidObject, _Object] = {}
        self._parts: list[_Part] = []
        owner = _FIRST
        for entity in objects:
            frame = mjcf.get_attachment_frame(entity.mjcf_model)
            self._owners[_geoms(physics, entity.mjcf_model)] = owner
            self._objects[entity] = _Object(
                entity,
                owner,
                int(physics.bind(frame).element_id),
                int(physics.bind(entity.free_joint).dofadr),
                entity.asset.label.pose,
            )
            owner += 1
        for furniture in furnishings:
            base = int(physics.bind(furniture.mjcf_model.worldbody.body[0]).element_id)
            for part in furniture.asset.parts:
                self._owners[furniture.part_geoms(physics, part.name)] = owner
                cavity = (
                    np.eye(4) if part.cavity is None else compose(np.eye(3), part.cavity.center)
                )
                self._parts.append(
                    _Part(
                        furniture,
                        part,
                        owner,
                        int(physics.bind(furniture.mjcf_model.find("body", part.name)).element_id),
                        base,
                        int(physics.bind(furniture.joint(part.name)).qposadr),
                        np.eye(4) if part.handle is None else part.handle.pose,
                        cavity,
                    )
                )
                owner += 1
        self._count = owner

    def reads(self, physics: mjcf.Physics) -> bool:
        """Whether this is the model it was made for."""
        return physics.model.ptr is self._model

    def read(
        self,
        physics: mjcf.Physics,
        movable: Mapping[str, RigidObject],
        furnishings: Sequence[ArticulatedObject],
    ) -> SceneState:
        """The state now; poses are those of the last forward kinematics.

        Args:
          physics: Of the model it was made for.
          movable: The objects in play, by the names that goals use.
          furnishings: The furniture in play.
        """
        data = physics.data.ptr
        touched, left, right = self._touching(data)
        objects = {}
        for name, entity in movable.items():
            thing = self._objects[entity]
            velocity = data.qvel[thing.velocity : thing.velocity + 6]
            objects[name] = ObjectState(
                label=entity.asset.label,
                label_pose=_pose(data.xpos[thing.body], data.xmat[thing.body]) @ thing.label,
                linear_speed=np.sqrt(velocity[:3] @ velocity[:3]),
                angular_speed=np.sqrt(velocity[3:] @ velocity[3:]),
                touched=touched[thing.owner],
                held=left[thing.owner] & right[thing.owner],
            )
        parts = {}
        for part in self._parts:
            if part.furniture not in furnishings:
                continue
            pose = _pose(data.xpos[part.body], data.xmat[part.body])
            cavity = part.part.cavity
            inside = pose
            if cavity is not None and not cavity.moves_with_part:
                inside = _pose(data.xpos[part.base], data.xmat[part.base])
            parts[part.part.name] = PartState(
                part=part.part,
                opening=data.qpos[part.position],
                handle_pose=pose @ part.handle,
                cavity_pose=inside @ part.cavity,
                touched=touched[part.owner],
            )
        return SceneState(
            tcp_pose=_pose(data.site_xpos[self._site], data.site_xmat[self._site]),
            gripper=data.qpos[self._fingers].sum(),
            objects=objects,
            parts=parts,
        )

    def touched(self, physics: mjcf.Physics, entity: RigidObject) -> bool:
        """Whether the robot touches this object now."""
        return bool(self._touching(physics.data.ptr)[0][self._objects[entity].owner])

    def _touching(self, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Who is touched by the robot, by its left pad and by its right pad; masks over owners."""
        masks = np.zeros((3, self._count), bool)
        if not data.ncon:  # as most of the time: none are computed between things asleep
            return masks[0], masks[1], masks[2]
        pairs = self._owners[data.contact.geom]
        pairs = pairs[pairs.min(axis=1) <= _RIGHT_PAD]
        if not len(pairs):
            return masks[0], masks[1], masks[2]
        first, second = pairs[:, 0], pairs[:, 1]
        for one, other in ((first, second), (second, first)):
            masks[0, other[one <= _RIGHT_PAD]] = True
            masks[1, other[one == _LEFT_PAD]] = True
            masks[2, other[one == _RIGHT_PAD]] = True
        return masks[0], masks[1], masks[2]


def _geoms(physics: mjcf.Physics, root: mjcf.RootElement) -> Int[np.ndarray, "n"]:
    return np.asarray(physics.bind(root.find_all("geom")).element_id)


def _pose(position: Float[np.ndarray, "3"], matrix: Float[np.ndarray, "9"]) -> np.ndarray:
    pose = np.zeros((4, 4))
    pose[3, 3] = 1.0
    pose[:3, :3] = matrix.reshape(3, 3)
    pose[:3, 3] = position
    return pose
