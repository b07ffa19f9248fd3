"""Where a scene's state is in the arrays of a compiled model, and what its objects and parts are like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from dm_control import mjcf
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.asset import MovingPart
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.mjcf.panda.robot import Panda
from manipose_mj.poses import Array, SymmetryGroup, compose

# Who a geom belongs to, in contacts; from FIRST on, objects and then parts.
ROBOT, LEFT_PAD, RIGHT_PAD, NOBODY, FIRST = 0, 1, 2, 3, 4


@dataclass(frozen=True)
class SceneIndices:
    """Rows of a model's arrays; found once per compiled model. JAX worlds may have rows of their own.

    Attributes:
      objects: Names that goals use.
      parts: The same of moving parts.
      tcp: The site.
      fingers: Of both finger joints, in `qpos`.
      bodies: That carry the objects' labels, then the parts' handles, then their cavities.
      speeds: Of the objects' free joints, in `qvel`: three that move, three that turn.
      openings: Of the parts' joints, in `qpos`.
      owners: Whom each geom belongs to: `ROBOT`, `LEFT_PAD`, `RIGHT_PAD`, `NOBODY` or who is in `owned`.
      owned: The numbers of the objects, then of the parts, in `owners`.
    """

    objects: tuple[str, ...]
    parts: tuple[str, ...]
    tcp: int
    fingers: tuple[int, ...]
    bodies: Int[Array, " bodies"]
    speeds: Int[Array, "objects 2 3"]
    openings: Int[Array, " parts"]
    owners: Int[Array, " geoms"]
    owned: Int[Array, " owned"]

    def select(self, objects: Mapping[str, int], parts: Sequence[int]) -> SceneIndices:
        """Those of some objects, under new names, and of some parts; both by their positions."""
        chosen, count = list(objects.values()), len(self.objects)
        return SceneIndices(
            objects=tuple(objects),
            parts=tuple(self.parts[i] for i in parts),
            tcp=self.tcp,
            fingers=self.fingers,
            bodies=self.bodies[_rows(chosen, parts, count, len(self.parts))],
            speeds=self.speeds[chosen],
            openings=self.openings[list(parts)],
            owners=self.owners,
            owned=self.owned[[*chosen, *(count + i for i in parts)]],
        )


@dataclass(frozen=True)
class SceneShapes:
    """What the objects and parts of a scene are like, in the order of its `SceneIndices`.

    Attributes:
      frames: `T_body_label` of the objects, `T_body_handle` and `T_body_cavity` of the parts.
      extents: Of the objects' bounding boxes, along their labels' axes [m].
      centers: Of those boxes, in the label frames [m].
      symmetries: Of the objects.
      ranges: Of the parts' joints [m or rad].
      cavity_extents: Full lengths [m]; zero without a cavity.
      has_cavity: Whether a part opens one.
    """

    frames: Float[Array, "*b bodies 4 4"]
    extents: Float[Array, "*b objects 3"]
    centers: Float[Array, "*b objects 3"]
    symmetries: tuple[SymmetryGroup, ...]
    ranges: Float[Array, "*b parts 2"]
    cavity_extents: Float[Array, "*b parts 3"]
    has_cavity: Bool[Array, "*b parts"]

    def select(self, objects: Sequence[int], parts: Sequence[int]) -> SceneShapes:
        """Those of some objects and parts, by their positions."""
        rows = _rows(objects, parts, len(self.symmetries), self.ranges.shape[-2])
        chosen, opened = list(objects), list(parts)
        return SceneShapes(
            frames=self.frames[..., rows, :, :],
            extents=self.extents[..., chosen, :],
            centers=self.centers[..., chosen, :],
            symmetries=tuple(self.symmetries[i] for i in objects),
            ranges=self.ranges[..., opened, :],
            cavity_extents=self.cavity_extents[..., opened, :],
            has_cavity=self.has_cavity[..., opened],
        )


def _rows(objects: Sequence[int], parts: Sequence[int], count: int, part_count: int) -> list[int]:
    """Of labels, handles and cavities."""
    handles = [count + i for i in parts]
    return [*objects, *handles, *(part_count + i for i in handles)]


def find_indices(
    physics: mjcf.Physics,
    robot: Panda,
    objects: Mapping[str, RigidObject],
    articulated: Sequence[ArticulatedObject],
) -> SceneIndices:
    """Where these objects and all parts of these articulated objects are in a compiled model."""
    owners = np.full(physics.model.ngeom, NOBODY)
    owners[_geoms(physics, robot.mjcf_model)] = ROBOT
    left, right = physics.bind(robot.pad_geoms).element_id
    owners[left], owners[right] = LEFT_PAD, RIGHT_PAD
    bodies, speeds, handles, cavities, openings = [], [], [], [], []
    for owner, entity in enumerate(objects.values(), start=FIRST):
        owners[_geoms(physics, entity.mjcf_model)] = owner
        frame = mjcf.get_attachment_frame(entity.mjcf_model)
        bodies.append(int(physics.bind(frame).element_id))
        speeds.append(int(physics.bind(entity.free_joint).dofadr) + np.arange(6))
    parts = [(entity, part) for entity in articulated for part in entity.asset.parts]
    for owner, (entity, part) in enumerate(parts, start=FIRST + len(objects)):
        owners[entity.part_geoms(physics, part.name)] = owner
        body = int(physics.bind(entity.mjcf_model.find("body", part.name)).element_id)
        base = int(physics.bind(entity.mjcf_model.worldbody.body[0]).element_id)
        fixed = part.cavity is not None and not part.cavity.moves_with_part
        handles.append(body)
        cavities.append(base if fixed else body)
        openings.append(int(physics.bind(entity.joint(part.name)).qposadr))
    return SceneIndices(
        objects=tuple(objects),
        parts=tuple(part.name for _, part in parts),
        tcp=int(physics.bind(robot.tcp_site).element_id),
        fingers=tuple(int(physics.bind(joint).qposadr) for joint in robot.finger_joints),
        bodies=np.array([*bodies, *handles, *cavities], int),
        speeds=np.array(speeds, int).reshape(-1, 2, 3),
        openings=np.array(openings, int),
        owners=owners,
        owned=FIRST + np.arange(len(objects) + len(parts)),
    )


def shapes_of(
    objects: Sequence[RigidObject], articulated: Sequence[ArticulatedObject]
) -> SceneShapes:
    """What these objects and all parts of these articulated objects are like."""
    labels = [entity.asset.label for entity in objects]
    parts = [part for entity in articulated for part in entity.asset.parts]
    frames = [label.pose for label in labels]
    frames += [np.eye(4) if part.handle is None else part.handle.pose for part in parts]
    frames += [_cavity_frame(part) for part in parts]
    cavities = [np.zeros(3) if part.cavity is None else part.cavity.extents for part in parts]
    return SceneShapes(
        frames=np.array(frames, float).reshape(-1, 4, 4),
        extents=np.array([label.extents for label in labels], float).reshape(-1, 3),
        centers=np.array([label.center for label in labels], float).reshape(-1, 3),
        symmetries=tuple(label.symmetry for label in labels),
        ranges=np.array([part.joint.range for part in parts], float).reshape(-1, 2),
        cavity_extents=np.array(cavities, float).reshape(-1, 3),
        has_cavity=np.array([part.cavity is not None for part in parts], bool),
    )


def _cavity_frame(part: MovingPart) -> Float[np.ndarray, "4 4"]:
    """`T_body_cavity`."""
    return np.eye(4) if part.cavity is None else compose(np.eye(3), part.cavity.center)


def _geoms(physics: mjcf.Physics, root: mjcf.RootElement) -> Int[np.ndarray, "n"]:
    return np.asarray(physics.bind(root.find_all("geom")).element_id)
