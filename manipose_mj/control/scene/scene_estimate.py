"""What the baseline knows of the scene, wherever it came from.

The oracle fills it from the simulator; an estimator fills it from clouds. Nothing after this point
knows the difference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import Cavity, GraspSet, Joint, StablePose
from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.scene.collision_query import AttachedObject, FixedObject
from manipose_mj.control.scene.geom_corners import geom_corners
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.poses import invert, transform


@dataclass(frozen=True)
class ObjectEstimate:
    """A rigid object.

    Attributes:
      name: What plans call it.
      pose: `T_world_object`.
      label: Its pose label, in the object frame.
      sample_grasps: Gives `grasps`, the same ones each time; called when somebody needs them.
      body: Its body in the planning scene.
      geoms: Mask of its geoms there, `(ngeom,)`.
      rests: Stable poses, in the order of `grasps.clear`; none where they are not known.
      category: Such as `"mug"`; empty where it is not known.
      uncertainty: How far its surface may be from where the planning scene has it [m].
      guessed_frame: Whether where its label is in it is but a guess, its shape being that of its own cloud: a pose that
        is asked for then leaves it a little in the air or in what it shall lie on.
      sample_more: Gives many more grasps, for where `grasps` do not do; None: there are no others.
      find_colours: Gives `colours`; called when somebody needs them.
    """

    name: str
    pose: Float[np.ndarray, "4 4"]
    label: PoseLabel
    sample_grasps: Callable[[], GraspSet]
    body: int
    geoms: Bool[np.ndarray, "ngeom"]
    rests: tuple[StablePose, ...] = ()
    category: str = ""
    uncertainty: float = 0.0
    guessed_frame: bool = False
    sample_more: Callable[[], GraspSet] | None = None
    find_colours: Callable[[], str] = str

    @property
    def grasps(self) -> GraspSet:
        """In the object frame."""
        return self.sample_grasps()

    @property
    def colours(self) -> str:
        """Words such as `red` or `blue and white`; empty where nobody knows."""
        return self.find_colours()

    @property
    def label_pose(self) -> Float[np.ndarray, "4 4"]:
        """`T_world_label`."""
        return self.pose @ self.label.pose

    def attached_to(
        self, tcp_pose: Float[np.ndarray, "4 4"], opening: float | None = None
    ) -> AttachedObject:
        """The object, from where it is now, in a hand at `T_world_tcp`.

        Args:
          tcp_pose: `T_world_tcp`.
          opening: Of the gripper that holds it [m]; None: as observed.
        """
        return self.held_at(invert(tcp_pose) @ self.pose, opening)

    def held_at(
        self, pose_tcp: Float[np.ndarray, "4 4"], opening: float | None = None
    ) -> AttachedObject:
        """The object at `T_tcp_object` in a hand; `opening` as of `attached_to`."""
        return AttachedObject(self.body, self.geoms, pose_tcp, opening, self.uncertainty)

    def corners(self, scene: PlanningScene) -> Float[np.ndarray, "v 3"]:
        """Points whose convex hull is the object's, label frame [m]; none where the scene does not have it."""
        corners = [geom_corners(scene.model, int(geom)) for geom in np.flatnonzero(self.geoms)]
        return transform(invert(self.label.pose), np.concatenate([np.zeros((0, 3)), *corners]))

    def box_around(
        self, scene: PlanningScene, rotation: Float[np.ndarray, "3 3"]
    ) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """The box around its shape, along the axes of a frame in which its label is turned so.

        Returns:
          Its middle from the label's origin `(3,)`, and half its lengths `(3,)` [m]; of the label's box where the scene does
          not have the object.
        """
        turned = self.corners(scene) @ rotation.T
        if not len(turned):
            return rotation @ self.label.center, self.label.reach(rotation)
        low, high = turned.min(axis=0), turned.max(axis=0)
        return (low + high) / 2, (high - low) / 2

    def placed_at(self, label_pose: Float[np.ndarray, "4 4"]) -> FixedObject:
        """The object with its label at `T_world_label`."""
        place = label_pose @ invert(self.label.pose)
        return FixedObject(self.body, self.geoms, place, self.uncertainty)


@dataclass(frozen=True)
class PartEstimate:
    """A drawer or door.

    Attributes:
      name: What plans call it.
      base_pose: `T_world_object` of the piece of furniture.
      pose: `T_world_part`, equal to `base_pose` while the joint is at zero.
      opening: Joint position [m or rad].
      joint: Kind, axis and limits, in the object frame.
      handle: Label of the handle, in the object frame.
      cavity: What it gives access to, in the object frame.
      body: Its body in the planning scene.
      geoms: Mask of its geoms there, `(ngeom,)`.
      bodies_inside: Bodies of the objects in its cavity, which move with a drawer.
      cavity_seen: Whether the cavity is known; else it is what is usual behind such a part.
      goes_on: Whether it was opened as far as is usual, and did not stop: it opens further than anybody knows.
      called: What an instruction calls it, such as `"middle drawer"`, where that is how it was found; else empty.
    """

    name: str
    base_pose: Float[np.ndarray, "4 4"]
    pose: Float[np.ndarray, "4 4"]
    opening: float
    joint: Joint
    handle: PoseLabel
    cavity: Cavity | None
    body: int
    geoms: Bool[np.ndarray, "ngeom"]
    bodies_inside: tuple[int, ...] = ()
    cavity_seen: bool = True
    goes_on: bool = False
    called: str = ""

    @property
    def handle_pose(self) -> Float[np.ndarray, "4 4"]:
        """`T_world_handle`."""
        return self.pose @ self.handle.pose


@dataclass(frozen=True)
class SceneEstimate:
    """All that one observation says.

    Attributes:
      joints: Of the arm `(7,)` [rad].
      opening: Of the gripper [m].
      objects: By name.
      parts: By name.
      scene: What a motion could hit; it has everything where the estimates have it.
      unseen: Categories of what goals are about and nothing has shown yet, by name.
    """

    joints: Float[np.ndarray, "7"]
    opening: float
    objects: dict[str, ObjectEstimate]
    parts: dict[str, PartEstimate]
    scene: PlanningScene
    unseen: Mapping[str, str] = field(default_factory=dict)

    @property
    def tcp_pose(self) -> Float[np.ndarray, "4 4"]:
        """`T_world_tcp`."""
        return self.scene.tcp_pose(self.joints)

    def in_hand(self, name: str) -> AttachedObject:
        """An object as the hand holds it now."""
        return self.objects[name].attached_to(self.tcp_pose)
