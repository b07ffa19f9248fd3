"""Goals about an object and the cavity that a drawer or door opens: into it, out of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from jaxtyping import Bool, Float

from manipose_mj.poses import Array, SymmetryGroup, compose, invert, namespace
from manipose_mj.small_matrices import product
from manipose_mj.tasks.goals import stages
from manipose_mj.tasks.goals.conditions import Tolerance, at_rest, inside_cavity
from manipose_mj.tasks.goals.goal import Goal, GoalFrame
from manipose_mj.tasks.scene.state import ObjectState, PartState, SceneState


@dataclass(frozen=True)
class InsideGoal(Goal):
    """The whole object shall rest in the cavity that `part` opens, released."""

    kind: ClassVar[str] = "inside"
    object: str
    part: str

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*#b"]:
        """Whether it holds in this state; never for a part without a cavity."""
        obj, part = state.objects[self.object], state.parts[self.part]
        inside = self._placed(obj, part, _in_cavity(obj, part), tolerance)
        return inside & at_rest(obj.linear_speed, obj.angular_speed, tolerance) & ~obj.touched

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*#b"]:
        """Open, reach, hold, carry into the cavity, let go."""
        obj, part = state.objects[self.object], state.parts[self.part]
        pose = _in_cavity(obj, part)
        xp = namespace(pose)
        beyond = xp.clip(xp.abs(pose[..., :3, 3]) - _half_extents(part, pose), 0.0, None)
        remaining = xp.sqrt(xp.sum(beyond**2, axis=-1))
        placed = self._placed(obj, part, pose, tolerance)
        by_itself = stages.object_progress(state, obj, placed, remaining, tolerance)
        found = stages.through_part(state, part, placed, by_itself)
        return xp.where(part.has_cavity, found, 0.0)

    @staticmethod
    def _placed(
        obj: ObjectState, part: PartState, pose: Float[Array, "*#b 4 4"], tolerance: Tolerance
    ) -> Bool[Array, "*#b"]:
        inside = inside_cavity(
            pose, obj.extents, obj.symmetry.axial, part.cavity_extents, tolerance.cavity_slack
        )
        return inside & part.has_cavity


@dataclass(frozen=True)
class TakenOutGoal(Goal):
    """The object shall rest on the table with its label's origin over a level rectangle, out of the
    cavity that `part` opens, released.

    Attributes: center: of the rectangle, in the world [m]; half_sides: along x and y [m].
    """

    kind: ClassVar[str] = "taken_out"
    object: str
    part: str
    center: Float[Array, "*#b 2"]
    half_sides: Float[Array, "*#b 2"]

    def _beyond(self, state: SceneState) -> Float[Array, "*#b 2"]:
        """How far the label's origin is outside the rectangle, along x and y [m]."""
        place = state.objects[self.object].label_pose[..., :2, 3]
        xp = namespace(place)
        center = xp.asarray(self.center, dtype=place.dtype)
        half = xp.asarray(self.half_sides, dtype=place.dtype)
        return xp.clip(xp.abs(place - center) - half, 0.0, None)

    def placed(self, state: SceneState) -> Bool[Array, "*#b"]:
        """Whether it is over the rectangle, no higher than it can lie, and out of the cavity."""
        obj, part = state.objects[self.object], state.parts[self.part]
        pose = _in_cavity(obj, part)
        xp = namespace(pose)
        over = xp.all(self._beyond(state) <= 0.0, axis=-1)
        extents = xp.asarray(obj.extents, dtype=pose.dtype)
        half_diagonal = xp.sqrt(xp.sum(extents**2, axis=-1)) / 2
        height = obj.label_pose[..., 2, 3]
        low = (height > 0.0) & (height < half_diagonal + 0.01)
        out = xp.any(xp.abs(pose[..., :3, 3]) > _half_extents(part, pose), axis=-1)
        return over & low & (out | xp.logical_not(part.has_cavity))

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*#b"]:
        """Whether it holds in this state."""
        obj = state.objects[self.object]
        rest = at_rest(obj.linear_speed, obj.angular_speed, tolerance)
        return self.placed(state) & rest & ~obj.touched

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*#b"]:
        """Open, reach, hold, carry to the rectangle, let go."""
        obj, part = state.objects[self.object], state.parts[self.part]
        beyond, placed = self._beyond(state), self.placed(state)
        xp = namespace(beyond)
        remaining = xp.sqrt(xp.sum(beyond**2, axis=-1))
        by_itself = stages.object_progress(state, obj, placed, remaining, tolerance)
        return stages.through_part(state, part, placed, by_itself)

    def goal_frame(self, symmetries: Mapping[str, SymmetryGroup]) -> GoalFrame:
        """The rectangle's middle, turned in any way."""
        xp = namespace(self.center)
        middle = xp.concat([self.center, xp.zeros_like(self.center[..., :1])], axis=-1)
        level = xp.broadcast_to(xp.eye(3, dtype=middle.dtype), (*middle.shape[:-1], 3, 3))
        symmetry = symmetries[self.object]
        return GoalFrame(self.object, compose(level, middle), symmetry, rotation_counts=False)


def _in_cavity(obj: ObjectState, part: PartState) -> Float[Array, "*#b 4 4"]:
    """`T_cavity_box`: the label's axes, in the middle of the object's bounding box."""
    pose = product(invert(part.cavity_pose), obj.label_pose)
    xp = namespace(pose)
    center = xp.asarray(obj.center, dtype=pose.dtype)
    moved = product(pose[..., :3, :3], center[..., None])
    shift = xp.concat([xp.zeros_like(pose[..., :3, :3]), moved], axis=-1)
    return pose + xp.concat([shift, xp.zeros_like(pose[..., 3:, :])], axis=-2)


def _half_extents(part: PartState, pose: Array) -> Float[Array, "*#b 3"]:
    """Of the cavity [m], as numbers of the pose's kind."""
    return namespace(pose).asarray(part.cavity_extents, dtype=pose.dtype) / 2
