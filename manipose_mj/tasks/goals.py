"""What a task wants, as data that any planner can read, and when it is met.

A task's goals are a tuple; success is all of them. Each is a frozen dataclass of names and arrays;
whether it is met is a pure function of the scene's state, NumPy or JAX.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.poses import Array, compose, invert, namespace, pose_error
from manipose_mj.tasks.scene_state import SceneState
from manipose_mj.tasks.success import Tolerance, at_rest, inside_cavity, pose_goal_met


class Goal(Protocol):
    """One condition of success."""

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
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


@dataclass(frozen=True)
class OrientationGoal:
    """The object's label shall rest on the table turned as `rotation` (`R_world_label`), up to its
    symmetry; anywhere, released."""

    object: str
    rotation: Float[np.ndarray, "3 3"]

    def error(self, state: SceneState) -> Float[Array, "*b"]:
        """The angle that is left [rad]."""
        thing = state.objects[self.object]
        xp = namespace(thing.label_pose)
        wanted = xp.asarray(compose(self.rotation, np.zeros(3)), dtype=thing.label_pose.dtype)
        return pose_error(thing.label_pose, wanted, thing.label.symmetry)[1]

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        thing = state.objects[self.object]
        rest = at_rest(thing.linear_speed, thing.angular_speed, tolerance)
        on_table = thing.label_pose[..., 2, 3] > 0.0
        return (self.error(state) < tolerance.rotation) & rest & on_table & ~thing.touched


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


@dataclass(frozen=True)
class OpenGoal:
    """The part's joint shall be open by at least `fraction` of its range."""

    part: str
    fraction: float = 0.9

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        return state.parts[self.part].fraction >= self.fraction


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


@dataclass(frozen=True)
class OnTableGoal:
    """The object shall still be on the table, not on the floor."""

    object: str

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        return state.objects[self.object].label_pose[..., 2, 3] > 0.0


def all_met(goals: tuple[Goal, ...], state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
    """Whether every goal is met: success."""
    met = goals[0].met(state, tolerance)
    for goal in goals[1:]:
        met = met & goal.met(state, tolerance)
    return met
