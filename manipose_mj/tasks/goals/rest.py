"""Goals about how an object rests: at a pose, turned in some way, on the table."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.poses import Array, SymmetryGroup, compose, namespace, pose_error
from manipose_mj.tasks.goals import stages
from manipose_mj.tasks.goals.conditions import Tolerance, at_rest, pose_goal_met
from manipose_mj.tasks.goals.goal import Goal, GoalFrame
from manipose_mj.tasks.scene.state import SceneState

_X_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class PoseGoal(Goal):
    """The object's label shall rest at `pose` (`T_world_label`), up to its symmetry, released."""

    kind: ClassVar[str] = "pose"
    object: str
    pose: Float[Array, "*b 4 4"]

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        obj = state.objects[self.object]
        return pose_goal_met(
            obj.label_pose,
            namespace(obj.label_pose).asarray(self.pose, dtype=obj.label_pose.dtype),
            obj.linear_speed,
            obj.angular_speed,
            obj.touched,
            obj.symmetry,
            tolerance,
        )

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """Reach, hold, carry, let go."""
        obj = state.objects[self.object]
        goal_pose = namespace(obj.label_pose).asarray(self.pose, dtype=obj.label_pose.dtype)
        distance, angle = pose_error(obj.label_pose, goal_pose, obj.symmetry)
        placed = (distance < tolerance.translation) & (angle < tolerance.rotation)
        remaining = distance + stages.turn_as_distance(angle)
        return stages.object_progress(state, obj, placed, remaining, tolerance)

    def goal_frame(self, symmetries: Mapping[str, SymmetryGroup]) -> GoalFrame:
        """The pose itself."""
        return GoalFrame(self.object, self.pose, symmetries[self.object])


@dataclass(frozen=True)
class TurnedGoal(Goal, abc.ABC):
    """The object shall rest on the table turned in some way; anywhere, released."""

    object: str

    @abc.abstractmethod
    def error(self, state: SceneState) -> Float[Array, "*b"]:
        """The angle that remains [rad]."""

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        obj = state.objects[self.object]
        rest = at_rest(obj.linear_speed, obj.angular_speed, tolerance)
        on_table = obj.label_pose[..., 2, 3] > 0.0
        return (self.error(state) < tolerance.rotation) & rest & on_table & ~obj.touched

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """Reach, hold, turn, set down."""
        obj = state.objects[self.object]
        angle = self.error(state)
        placed = (angle < tolerance.rotation) & (obj.label_pose[..., 2, 3] > 0.0)
        remaining = stages.turn_as_distance(angle)
        return stages.object_progress(state, obj, placed, remaining, tolerance)


@dataclass(frozen=True)
class OrientationGoal(TurnedGoal):
    """The object's label shall rest on the table turned as `rotation` (`R_world_label`), up to its
    symmetry; anywhere, released."""

    kind: ClassVar[str] = "orientation"
    rotation: Float[Array, "*b 3 3"]

    def error(self, state: SceneState) -> Float[Array, "*b"]:
        """The angle that remains [rad]."""
        obj = state.objects[self.object]
        goal_pose = namespace(obj.label_pose).asarray(self._pose(), dtype=obj.label_pose.dtype)
        return pose_error(obj.label_pose, goal_pose, obj.symmetry)[1]

    def goal_frame(self, symmetries: Mapping[str, SymmetryGroup]) -> GoalFrame:
        """The rotation, anywhere."""
        symmetry = symmetries[self.object]
        return GoalFrame(self.object, self._pose(), symmetry, translation_counts=False)

    def _pose(self) -> Float[Array, "*b 4 4"]:
        """The rotation at the world's origin."""
        return compose(self.rotation, namespace(self.rotation).zeros_like(self.rotation[..., 0]))


@dataclass(frozen=True)
class UprightGoal(TurnedGoal):
    """The object shall rest upright, its label's X along the vertical, turned about it as it likes;
    anywhere, released."""

    kind: ClassVar[str] = "upright"

    def error(self, state: SceneState) -> Float[Array, "*b"]:
        """The angle between the label's X and the vertical [rad]."""
        up = state.objects[self.object].label_pose[..., :3, 0]
        xp = namespace(up)
        # From the chord: the cosine is too flat near nothing and near half a turn.
        chord = xp.sqrt(xp.sum((up - xp.asarray([0.0, 0.0, 1.0], dtype=up.dtype)) ** 2, axis=-1))
        return 2 * xp.asin(xp.clip(chord / 2, 0.0, 1.0))

    def goal_frame(self, symmetries: Mapping[str, SymmetryGroup]) -> GoalFrame:
        """X up, anywhere; every turn about it counts as the same."""
        pose = compose(_X_UP, np.zeros(3))
        return GoalFrame(self.object, pose, SymmetryGroup.about_x(), translation_counts=False)


@dataclass(frozen=True)
class OnTableGoal(Goal):
    """The object shall still be on the table, not on the floor."""

    kind: ClassVar[str] = "on_table"
    object: str

    def met(self, state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
        """Whether it holds in this state."""
        return state.objects[self.object].label_pose[..., 2, 3] > 0.0

    def progress(self, state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
        """All or nothing."""
        pose = state.objects[self.object].label_pose
        return namespace(pose).where(self.met(state, tolerance), 1.0, 0.0)
