"""What of a scene has a pose to be observed: objects, handles, joint axes, goals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from asset_pipeline.assets import MovingPart
from asset_pipeline.geometry import Joint
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.poses import SymmetryGroup, compose
from manipose_mj.tasks.goals import Goal, OrientationGoal, PoseGoal, TakenOutGoal, UprightGoal

_UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # X up


class PosedScene(Protocol):
    """What observations need to know of a task; attributes as in `ManipulationTask`."""

    @property
    def movable(self) -> dict[str, RigidObject]: ...

    @property
    def furnishings(self) -> tuple[ArticulatedObject, ...]: ...

    @property
    def goals(self) -> tuple[Goal, ...]: ...

    @property
    def landmarks(self) -> Mapping[str, Carried]: ...

    @property
    def noise_seed(self) -> int | None:
        """Of this episode; None before the first."""
        ...


@dataclass(frozen=True)
class Carried:
    """A thing that is fixed to a body.

    Attributes:
      body: The body's MJCF element.
      pose: `T_body_thing`.
      symmetry: Of what is at that pose; None for frames that have none.
    """

    body: mjcf.Element
    pose: Float[np.ndarray, "4 4"]
    symmetry: SymmetryGroup | None


@dataclass(frozen=True)
class Wanted:
    """A pose that a goal asks of an object.

    Attributes:
      pose: `T_world_label`; its translation is zero where any place will do, the middle of an area,
        at the table's height, where the object shall lie in one.
      symmetry: Rotations of the label after which the goal is met as well.
      place: Whether the translation counts.
      turn: Whether the rotation counts.
    """

    pose: Float[np.ndarray, "4 4"]
    symmetry: SymmetryGroup
    place: bool = True
    turn: bool = True


def furniture_things(furnishings: Sequence[ArticulatedObject]) -> dict[str, Carried]:
    """`handle_*` and `joint_*` of every moving part."""
    things = {}
    for furniture in furnishings:
        for part in furniture.asset.parts:
            own = part_things(furniture, part)
            things |= {f"{name}_{part.name}": own[name] for name in own if name != "cavity"}
    return things


def part_things(furniture: ArticulatedObject, part: MovingPart) -> dict[str, Carried]:
    """`joint`, `handle` and `cavity` of a part, the latter two where it has them."""
    model = furniture.mjcf_model
    base, body = model.worldbody.body[0], model.find("body", part.name)
    things = {"joint": Carried(base, joint_frame(part.joint), None)}
    if part.handle is not None:
        things["handle"] = Carried(body, part.handle.pose, part.handle.symmetry)
    if part.cavity is not None:
        carrier = body if part.cavity.moves_with_part else base
        things["cavity"] = Carried(carrier, compose(np.eye(3), part.cavity.center), None)
    return things


def movable_thing(entity: RigidObject) -> Carried:
    """The label of a rigid object."""
    label = entity.asset.label
    return Carried(mjcf.get_attachment_frame(entity.mjcf_model), label.pose, label.symmetry)


def joint_frame(joint: Joint) -> Float[np.ndarray, "4 4"]:
    """`T_object_joint`: X along the axis, positive is opening; Y level, the object's y where
    X is vertical; the origin is the joint's point on the axis."""
    x = np.asarray(joint.axis, float) / np.linalg.norm(joint.axis)
    y = np.cross([0.0, 0.0, 1.0], x)
    if np.linalg.norm(y) < 1e-3:
        y = np.array([0.0, 1.0, 0.0]) - x[1] * x
    y /= np.linalg.norm(y)
    return compose(np.stack([x, y, np.cross(x, y)], axis=1), np.asarray(joint.origin, float))


def wanted(goal: Goal, movable: Mapping[str, RigidObject]) -> tuple[str, Wanted] | None:
    """The object that a goal is about and how it shall lie; None for goals that ask for no pose."""
    if not isinstance(goal, (PoseGoal, OrientationGoal, UprightGoal, TakenOutGoal)):
        return None
    symmetry = movable[goal.object].asset.label.symmetry
    if isinstance(goal, PoseGoal):
        found = Wanted(goal.pose, symmetry)
    elif isinstance(goal, OrientationGoal):
        found = Wanted(compose(goal.rotation, np.zeros(3)), symmetry, place=False)
    elif isinstance(goal, UprightGoal):
        found = Wanted(compose(_UPRIGHT, np.zeros(3)), SymmetryGroup.about_x(), place=False)
    else:
        middle = np.array([*goal.center, 0.0])
        found = Wanted(compose(np.eye(3), middle), symmetry, turn=False)
    return goal.object, found


def wanted_poses(goals: Sequence[Goal], movable: Mapping[str, RigidObject]) -> dict[str, Wanted]:
    """What the goals ask for, by the names of the objects."""
    return dict(found for goal in goals if (found := wanted(goal, movable)) is not None)
