"""The state of a scene as a small struct of arrays: what goals, rewards and success are functions of.

Leaves are NumPy or JAX arrays with any leading batch dimensions `*b`: what an object is differs between
worlds as much as where it is. What is the same in all worlds may go without batch dimensions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.poses import Array, SymmetryGroup


@dataclass(frozen=True)
class ObjectState:
    """A rigid object.

    Attributes:
      extents: Of its bounding box along the label's axes [m].
      symmetry: Of its shape, in the label's frame.
      label_pose: `T_world_label`.
      linear_speed: [m/s].
      angular_speed: [rad/s].
      touched: Whether the robot touches it.
      held: Whether both finger pads touch it.
      center: Of its bounding box, in the label's frame [m].
    """

    extents: Float[Array, "*#b 3"]
    symmetry: SymmetryGroup
    label_pose: Float[Array, "*#b 4 4"]
    linear_speed: Float[Array, "*#b"]
    angular_speed: Float[Array, "*#b"]
    touched: Bool[Array, "*#b"]
    held: Bool[Array, "*#b"]
    center: Float[Array, "*#b 3"] = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class PartState:
    """A drawer or a door.

    Attributes:
      range: Least and greatest joint position [m or rad]; shut is the least.
      cavity_extents: Full lengths of the cavity that it opens [m]; zero without one.
      has_cavity: Whether it opens one.
      opening: Joint position [m or rad].
      handle_pose: `T_world_handle`; of the part itself where it has no handle.
      cavity_pose: `T_world_cavity`; of the part itself where it opens none.
      touched: Whether the robot touches it.
    """

    range: Float[Array, "*#b 2"]
    cavity_extents: Float[Array, "*#b 3"]
    has_cavity: Bool[Array, "*#b"]
    opening: Float[Array, "*#b"]
    handle_pose: Float[Array, "*#b 4 4"]
    cavity_pose: Float[Array, "*#b 4 4"]
    touched: Bool[Array, "*#b"]

    @property
    def fraction(self) -> Float[Array, "*#b"]:
        """How far it is open, of its range: 0 shut, 1 wide open."""
        low, high = self.range[..., 0], self.range[..., 1]
        return (self.opening - low) / (high - low)


@dataclass(frozen=True)
class SceneState:
    """Attributes: tcp_pose, `T_world_tcp`; gripper, the opening between the pads [m]; objects and
    parts by the names that goals use."""

    tcp_pose: Float[Array, "*#b 4 4"]
    gripper: Float[Array, "*#b"]
    objects: Mapping[str, ObjectState] = field(default_factory=dict)
    parts: Mapping[str, PartState] = field(default_factory=dict)
