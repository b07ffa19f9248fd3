"""What of a scene has a pose to be observed: objects, handles, joint axes, goals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.poses import SymmetryGroup, compose
from manipose_mj.tasks.goals import Goal, GoalFrame


class PosedScene(Protocol):
    """What observations need to know of a task; attributes as in `ManipulationTask`."""

    @property
    def objects(self) -> dict[str, RigidObject]: ...

    @property
    def articulated_objects(self) -> tuple[ArticulatedObject, ...]: ...

    @property
    def goals(self) -> tuple[Goal, ...]: ...

    @property
    def extra_frames(self) -> Mapping[str, BodyFrame]: ...

    @property
    def noise_seed(self) -> int | None:
        """Of this episode; None before the first."""
        ...


@dataclass(frozen=True)
class BodyFrame:
    """A thing that is fixed to a body.

    Attributes:
      body: The body's MJCF element.
      pose: `T_body_frame`.
      symmetry: Of what is at that pose; None for frames that have none.
    """

    body: mjcf.Element
    pose: Float[np.ndarray, "4 4"]
    symmetry: SymmetryGroup | None


def furniture_frames(furniture: Sequence[ArticulatedObject]) -> dict[str, BodyFrame]:
    """`handle_*` and `joint_*` of every moving part."""
    frames = {}
    for piece in furniture:
        for part in piece.asset.parts:
            own = part_frames(piece, part)
            frames |= {f"{name}_{part.name}": own[name] for name in own if name != "cavity"}
    return frames


def part_frames(furniture: ArticulatedObject, part: MovingPart) -> dict[str, BodyFrame]:
    """`joint`, `handle` and `cavity` of a part, the latter two where it has them."""
    model = furniture.mjcf_model
    base, body = model.worldbody.body[0], model.find("body", part.name)
    frames = {"joint": BodyFrame(base, joint_frame(part.joint), None)}
    if part.handle is not None:
        frames["handle"] = BodyFrame(body, part.handle.pose, part.handle.symmetry)
    if part.cavity is not None:
        carrier = body if part.cavity.moves_with_part else base
        frames["cavity"] = BodyFrame(carrier, compose(np.eye(3), part.cavity.center), None)
    return frames


def object_frame(entity: RigidObject) -> BodyFrame:
    """The label of a rigid object."""
    label = entity.asset.label
    return BodyFrame(mjcf.get_attachment_frame(entity.mjcf_model), label.pose, label.symmetry)


def joint_frame(joint: Joint) -> Float[np.ndarray, "4 4"]:
    """`T_object_joint`: X along the axis, positive is opening; Y level, the object's y where
    X is vertical; the origin is the joint's point on the axis."""
    x = np.asarray(joint.axis, float) / np.linalg.norm(joint.axis)
    y = np.cross([0.0, 0.0, 1.0], x)
    if np.linalg.norm(y) < 1e-3:
        y = np.array([0.0, 1.0, 0.0]) - x[1] * x
    y /= np.linalg.norm(y)
    return compose(np.stack([x, y, np.cross(x, y)], axis=1), np.asarray(joint.origin, float))


def goal_frames(goals: Sequence[Goal], objects: Mapping[str, RigidObject]) -> dict[str, GoalFrame]:
    """What the goals ask for, by the names of the objects."""
    symmetries = {name: entity.asset.label.symmetry for name, entity in objects.items()}
    frames = (goal.goal_frame(symmetries) for goal in goals)
    return {frame.object: frame for frame in frames if frame is not None}
