"""What the baseline believes about the scene, wherever it came from.

The oracle fills it from the simulator; an estimator fills it from clouds. Nothing after this point
knows the difference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float

from asset_pipeline.assets import Cavity, GraspSet, Joint, StablePose
from asset_pipeline.labelling.label import PoseLabel
from manipose_mj.control.planning_scene import PlanningScene


@dataclass(frozen=True)
class ObjectBelief:
    """A rigid object.

    Attributes:
      name: What plans call it.
      pose: `T_world_object`.
      label: Its pose label, in the object frame.
      grasps: In the object frame.
      body: Its body in the planning scene.
      geoms: Mask of its geoms there, `(ngeom,)`.
      rests: Stable poses, in the order of `grasps.clear`; none where they are not known.
    """

    name: str
    pose: Float[np.ndarray, "4 4"]
    label: PoseLabel
    grasps: GraspSet
    body: int
    geoms: Bool[np.ndarray, "ngeom"]
    rests: tuple[StablePose, ...] = ()

    @property
    def label_pose(self) -> Float[np.ndarray, "4 4"]:
        """`T_world_label`."""
        return self.pose @ self.label.pose


@dataclass(frozen=True)
class PartBelief:
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
      contents: Bodies of the objects in its cavity, which move with a drawer.
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
    contents: tuple[int, ...] = ()

    @property
    def handle_pose(self) -> Float[np.ndarray, "4 4"]:
        """`T_world_handle`."""
        return self.pose @ self.handle.pose


@dataclass(frozen=True)
class Belief:
    """Attributes: joints `(7,)` [rad] and opening [m] of the robot; objects and parts by name."""

    joints: Float[np.ndarray, "7"]
    opening: float
    objects: dict[str, ObjectBelief]
    parts: dict[str, PartBelief]


class Senses(Protocol):
    """Where a policy's knowledge comes from.

    Attributes:
      sources: `"true"` or `"estimated"` of what it knows of `"objects"` and `"furniture"`.
    """

    sources: Mapping[str, str]

    def begin(self, seed: int) -> PlanningScene:
        """An episode begins.

        Args:
          seed: Of whatever is drawn.

        Returns:
          The scene that beliefs of this episode name bodies and geoms of.
        """
        ...

    def robot(self) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint angles [rad] and opening [m], cheap enough for every control step."""
        ...

    def look(self) -> Belief:
        """The whole belief; the planning scene is brought up to date with it."""
        ...

    def hold(self, name: str | None) -> None:
        """The hand holds this from now on; None: it has let go."""
        ...
