"""What a collision check assumes: clearances, the gripper, what moves with it, what it may touch."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

# Contacts are detected this far apart [m]; clearances asked for must be smaller.
DETECTION_DISTANCE = 0.012


@dataclass(frozen=True)
class Clearance:
    """Smallest distances allowed [m]; negative where touching is part of the motion.

    Attributes:
      arm: Between the robot and everything it may not touch.
      target: Between the gripper and the object it is about to take or has just let go.
      attached: Between what is attached and everything but the gripper.
      allows_contact: Whether the gripper and what is attached may push loose objects aside, as far
        as the query's contact allowance.
    """

    arm: float
    target: float
    attached: float
    allows_contact: bool = False

    def deeper(self, uncertainty: float) -> Clearance:
        """The same of an attached object whose surface is uncertain [m]: where it may touch, it may seem deeper in."""
        if self.attached >= 0:
            return self
        return replace(self, attached=self.attached - uncertainty)


# Paths through free space; the same once their corners are rounded; the same where the ends leave
# less room; motions that end in contact.
TRANSIT = Clearance(arm=0.008, target=0.0, attached=0.012)
ROUNDED = Clearance(arm=0.003, target=0.0, attached=0.006)
GRAZING = Clearance(arm=0.001, target=0.0, attached=0.0)
CONTACT = Clearance(arm=0.003, target=-0.003, attached=-0.003, allows_contact=True)


@dataclass(frozen=True)
class AttachedObject:
    """An object that moves with the gripper.

    Attributes:
      body: Its body in the planning scene.
      geoms: Mask of its geoms there, `(ngeom,)`.
      pose_tcp: `T_tcp_object`.
      opening: Of the gripper that holds it [m]; None: as observed.
      uncertainty: How far its surface may be from where the scene has it [m]: so much deeper it may seem to be in
        what it touches.
    """

    body: int
    geoms: Bool[np.ndarray, "ngeom"]
    pose_tcp: Float[np.ndarray, "4 4"]
    opening: float | None = None
    uncertainty: float = 0.0

    def pose(self, tcp_pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        """`T_world_object` with the TCP at `T_world_tcp`."""
        return tcp_pose @ self.pose_tcp

    def query(self, clearance: Clearance = TRANSIT) -> CollisionQuery:
        """Whether the arm collides while it holds the object."""
        clearance = clearance.deeper(self.uncertainty)
        return CollisionQuery(clearance, opening=self.opening, attached=self)


@dataclass(frozen=True)
class FixedObject:
    """An object at a fixed place, checked like one that is attached.

    Attributes:
      body: Its body in the planning scene.
      geoms: Mask of its geoms there, `(ngeom,)`.
      place: `T_world_object`.
      uncertainty: As of `AttachedObject`.
    """

    body: int
    geoms: Bool[np.ndarray, "ngeom"]
    place: Float[np.ndarray, "4 4"]
    uncertainty: float = 0.0

    def pose(self, tcp_pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        """The place, wherever the TCP is."""
        del tcp_pose
        return self.place

    def query(self, clearance: Clearance = TRANSIT) -> CollisionQuery:
        """Whether the object or the arm collides."""
        return CollisionQuery(clearance.deeper(self.uncertainty), attached=self)


@dataclass(frozen=True)
class CollisionQuery:
    """All that a collision check assumes beside the scene and the arm's configuration.

    Attributes:
      clearance: What counts as too close.
      opening: Of the gripper [m]; None: as observed.
      target: Mask of the geoms that the gripper may touch, `(ngeom,)`.
      attached: What is checked together with the robot.
      contact_allowance: How far loose objects may be pushed aside where the clearance allows
        contact [m].
      support_allowance: How much nearer the gripper may come to what is fixed, such as the table, where the
        clearance allows contact [m].
      depths: How deep the robot may be in each geom, whatever the clearance, `(ngeom,)` [m]; None: in none.
    """

    clearance: Clearance = TRANSIT
    opening: float | None = None
    target: Bool[np.ndarray, "ngeom"] | None = None
    attached: AttachedObject | FixedObject | None = None
    contact_allowance: float = 0.0
    support_allowance: float = 0.0
    depths: Float[np.ndarray, "ngeom"] | None = None

    def keeping(self, clearance: Clearance) -> CollisionQuery:
        """The same question with another clearance."""
        return replace(self, clearance=clearance)
