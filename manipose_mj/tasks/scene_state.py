"""The state of a scene as a small struct of arrays: what goals, rewards and success are functions of.

Leaves are NumPy or JAX arrays with any leading batch dimensions `*b`, the same for all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from jaxtyping import Bool, Float

from asset_pipeline.assets import MovingPart
from asset_pipeline.labelling.label import PoseLabel
from manipose_mj.poses import Array


@dataclass(frozen=True)
class ObjectState:
    """A rigid object.

    Attributes:
      label: Its pose label; the same in all worlds.
      label_pose: `T_world_label`.
      linear_speed: [m/s].
      angular_speed: [rad/s].
      touched: Whether the robot touches it.
      held: Whether both finger pads touch it.
    """

    label: PoseLabel
    label_pose: Float[Array, "*b 4 4"]
    linear_speed: Float[Array, "*b"]
    angular_speed: Float[Array, "*b"]
    touched: Bool[Array, "*b"]
    held: Bool[Array, "*b"]


@dataclass(frozen=True)
class PartState:
    """A drawer or a door.

    Attributes:
      part: What it is; the same in all worlds.
      opening: Joint position [m or rad].
      handle_pose: `T_world_handle`; of the part itself where it has no handle.
      cavity_pose: `T_world_cavity`; of the part itself where it opens none.
      touched: Whether the robot touches it.
    """

    part: MovingPart
    opening: Float[Array, "*b"]
    handle_pose: Float[Array, "*b 4 4"]
    cavity_pose: Float[Array, "*b 4 4"]
    touched: Bool[Array, "*b"]

    @property
    def fraction(self) -> Float[Array, "*b"]:
        """How far it is open, of its range: 0 shut, 1 wide open."""
        low, high = self.part.joint.range
        return (self.opening - low) / (high - low)


@dataclass(frozen=True)
class SceneState:
    """Attributes: tcp_pose, `T_world_tcp`; gripper, the opening between the pads [m]; objects and
    parts by the names that goals use."""

    tcp_pose: Float[Array, "*b 4 4"]
    gripper: Float[Array, "*b"]
    objects: Mapping[str, ObjectState] = field(default_factory=dict)
    parts: Mapping[str, PartState] = field(default_factory=dict)
