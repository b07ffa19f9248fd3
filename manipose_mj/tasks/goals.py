"""What a task wants, as data that any planner can read, and when it is met.

A task's goals are a tuple; success is all of them. Each is a frozen dataclass of names and arrays;
whether it is met is a pure function of the scene's state, NumPy or JAX.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.poses import Array, compose, invert, namespace, pose_error
from manipose_mj.tasks import shaping
from manipose_mj.tasks.scene_state import SceneState
from manipose_mj.tasks.success import Tolerance, at_rest, inside_cavity, pose_goal_met


class Goal(Protocol):
    """One condition of success."""

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        ...

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """How near it is, in [0, 1], for dense rewards; from `shaping.PLACED` on it is all but met."""
        ...


@dataclass(frozen=True)
class PoseGoal:
    """The object's label shall rest at `pose` (`T_world_label`), up to its symmetry, released."""

    object: str
    pose: Float[np.ndarray, "4 4"]

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        thing = state.objects[self.object]
        return pose_goal_met(
            thing.label_pose,
            namespace(thing.label_pose).asarray(self.pose, dtype=thing.label_pose.dtype),
            thing.linear_speed,
            thing.angular_speed,
            thing.touched,
            thing.label.symmetry,
            tolerance,
        )

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """Reach, hold, carry, let go."""
        thing = state.objects[self.object]
        wanted = namespace(thing.label_pose).asarray(self.pose, dtype=thing.label_pose.dtype)
        way, angle = pose_error(thing.label_pose, wanted, thing.label.symmetry)
        placed = (way < tolerance.translation) & (angle < tolerance.rotation)
        left = way + shaping.turn_as_way(angle)
        return shaping.object_progress(state, thing, placed, left, tolerance)


@dataclass(frozen=True)
class TurnedGoal(abc.ABC):
    """The object shall rest on the table turned in some way; anywhere, released."""

    object: str

    @abc.abstractmethod
    def error(self, state: SceneState) -> Float[Array, "*b"]:
        """The angle that is left [rad]."""

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        thing = state.objects[self.object]
        rest = at_rest(thing.linear_speed, thing.angular_speed, tolerance)
        on_table = thing.label_pose[..., 2, 3] > 0.0
        return (self.error(state) < tolerance.rotation) & rest & on_table & ~thing.touched

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """Reach, hold, turn, set down."""
        thing = state.objects[self.object]
        angle = self.error(state)
        placed = (angle < tolerance.rotation) & (thing.label_pose[..., 2, 3] > 0.0)
        left = shaping.turn_as_way(angle)
        return shaping.object_progress(state, thing, placed, left, tolerance)


@dataclass(frozen=True)
class OrientationGoal(TurnedGoal):
    """The object's label shall rest on the table turned as `rotation` (`R_world_label`), up to its
    symmetry; anywhere, released."""

    rotation: Float[np.ndarray, "3 3"]

    def error(self, state: SceneState) -> Float[Array, "*b"]:
        """The angle that is left [rad]."""
        thing = state.objects[self.object]
        xp = namespace(thing.label_pose)
        wanted = xp.asarray(compose(self.rotation, np.zeros(3)), dtype=thing.label_pose.dtype)
        return pose_error(thing.label_pose, wanted, thing.label.symmetry)[1]


@dataclass(frozen=True)
class UprightGoal(TurnedGoal):
    """The object shall rest upright, its label's X along the vertical, turned about it as it likes;
    anywhere, released."""

    def error(self, state: SceneState) -> Float[Array, "*b"]:
        """The angle between the label's X and the vertical [rad]."""
        up = state.objects[self.object].label_pose[..., :3, 0]
        xp = namespace(up)
        # From the chord: the cosine is too flat near nothing and near half a turn.
        chord = xp.sqrt(xp.sum((up - xp.asarray([0.0, 0.0, 1.0], dtype=up.dtype)) ** 2, axis=-1))
        return 2 * xp.asin(xp.clip(chord / 2, 0.0, 1.0))


@dataclass(frozen=True)
class InsideGoal:
    """The whole object shall rest in the cavity that `part` opens, released."""

    object: str
    part: str

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state; never for a part without a cavity."""
        thing, furniture = state.objects[self.object], state.parts[self.part]
        cavity = furniture.part.cavity
        if cavity is None:
            return thing.touched & ~thing.touched
        inside = inside_cavity(
            invert(furniture.cavity_pose) @ thing.label_pose,
            thing.label.extents,
            thing.label.symmetry.axial,
            cavity.extents,
            tolerance.cavity_slack,
        )
        return inside & at_rest(thing.linear_speed, thing.angular_speed, tolerance) & ~thing.touched

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """Open, reach, hold, carry inside, let go."""
        thing, furniture = state.objects[self.object], state.parts[self.part]
        xp = namespace(thing.label_pose)
        if furniture.part.cavity is None:
            return xp.zeros_like(thing.linear_speed)
        in_cavity = invert(furniture.cavity_pose) @ thing.label_pose
        half = xp.asarray(furniture.part.cavity.extents, dtype=in_cavity.dtype) / 2
        beyond = xp.clip(xp.abs(in_cavity[..., :3, 3]) - half, 0.0, None)
        left = xp.sqrt(xp.sum(beyond**2, axis=-1))
        placed = inside_cavity(
            in_cavity,
            thing.label.extents,
            thing.label.symmetry.axial,
            furniture.part.cavity.extents,
            tolerance.cavity_slack,
        )
        by_itself = shaping.object_progress(state, thing, placed, left, tolerance)
        return shaping.through_part(state, furniture, placed, by_itself)


@dataclass(frozen=True)
class TakenOutGoal:
    """The object shall rest on the table with its label's origin over a level rectangle, out of the
    cavity that `part` opens, released.

    Attributes: center: of the rectangle, in the world [m]; half_sides: along x and y [m].
    """

    object: str
    part: str
    center: Float[np.ndarray, "2"]
    half_sides: Float[np.ndarray, "2"]

    def _beyond(self, state: SceneState) -> Float[Array, "*b 2"]:
        """How far the label's origin is outside the rectangle, along x and y [m]."""
        place = state.objects[self.object].label_pose[..., :2, 3]
        xp = namespace(place)
        center = xp.asarray(self.center, dtype=place.dtype)
        half = xp.asarray(self.half_sides, dtype=place.dtype)
        return xp.clip(xp.abs(place - center) - half, 0.0, None)

    def placed(self, state: SceneState) -> Bool[Array, "*b"]:
        """Whether it is over the rectangle, no higher than it can lie, and out of the cavity."""
        thing, furniture = state.objects[self.object], state.parts[self.part]
        pose = thing.label_pose
        xp = namespace(pose)
        over = xp.all(self._beyond(state) <= 0.0, axis=-1)
        half_diagonal = float(np.linalg.norm(thing.label.extents)) / 2
        low = (pose[..., 2, 3] > 0.0) & (pose[..., 2, 3] < half_diagonal + 0.01)
        cavity = furniture.part.cavity
        if cavity is None:
            return over & low
        in_cavity = (invert(furniture.cavity_pose) @ pose)[..., :3, 3]
        half = xp.asarray(cavity.extents, dtype=pose.dtype) / 2
        return over & low & xp.any(xp.abs(in_cavity) > half, axis=-1)

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        thing = state.objects[self.object]
        rest = at_rest(thing.linear_speed, thing.angular_speed, tolerance)
        return self.placed(state) & rest & ~thing.touched

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """Open, reach, hold, carry to the rectangle, let go."""
        thing, furniture = state.objects[self.object], state.parts[self.part]
        beyond, placed = self._beyond(state), self.placed(state)
        xp = namespace(beyond)
        left = xp.sqrt(xp.sum(beyond**2, axis=-1))
        by_itself = shaping.object_progress(state, thing, placed, left, tolerance)
        return shaping.through_part(state, furniture, placed, by_itself)


@dataclass(frozen=True)
class OpenGoal:
    """The part's joint shall be open by at least `fraction` of its range."""

    part: str
    fraction: float = 0.9

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        return state.parts[self.part].fraction >= self.fraction

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """Reach, open."""
        furniture = state.parts[self.part]
        return shaping.part_progress(state, furniture, furniture.fraction / self.fraction)


@dataclass(frozen=True)
class ShutGoal:
    """The part's joint shall be shut: by `fraction` of its range, or, without one, to within
    the tolerance."""

    part: str
    fraction: float | None = None

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        furniture = state.parts[self.part]
        if self.fraction is not None:
            return 1 - furniture.fraction >= self.fraction
        return furniture.opening - furniture.part.joint.range[0] < tolerance.shut

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """Reach, shut."""
        furniture = state.parts[self.part]
        return shaping.part_progress(state, furniture, 1 - furniture.fraction)


@dataclass(frozen=True)
class OnTableGoal:
    """The object shall still be on the table, not on the floor."""

    object: str

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        return state.objects[self.object].label_pose[..., 2, 3] > 0.0

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """All or nothing."""
        pose = state.objects[self.object].label_pose
        return namespace(pose).where(self.met(state, tolerance), 1.0, 0.0)


def all_met(goals: tuple[Goal, ...], state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
    """Whether every goal is met: success."""
    met = goals[0].met(state, tolerance)
    for goal in goals[1:]:
        met = met & goal.met(state, tolerance)
    return met
