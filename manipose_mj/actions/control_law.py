"""What an action means, as pure functions of arrays: NumPy or JAX, the same for one world and for many.

A control law takes what it remembers and an action, and says where the position servos shall go. Laws of
joints compute with any batch dimensions `*b`; those that move the TCP with one world, or under `jax.vmap`.
"""

from __future__ import annotations

import abc
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.poses import Array, namespace


class Memory(NamedTuple):
    """What a control law remembers between physics steps; of one structure for all laws.

    Attributes:
      joints: Joint targets [rad].
      opening: Between the pads [m].
      lead: What velocity targets add to what the servos are sent [rad].
      velocity: At which the joint targets move [rad/s].
      goal: Joint angles that the joint targets are on their way to [rad].
      pose: `T_base_tcp` that was asked for last.
    """

    joints: Float[Array, "*b 7"]
    opening: Float[Array, "*b"]
    lead: Float[Array, "*b 7"]
    velocity: Float[Array, "*b 7"]
    goal: Float[Array, "*b 7"]
    pose: Float[Array, "*b 4 4"]

    @classmethod
    def at(cls, joints: Float[Array, "*b 7"], opening: Float[Array, "*b"]) -> Memory:
        """Of a robot at rest, which shall stay where it is."""
        xp = namespace(joints)
        nothing = xp.zeros_like(joints)
        pose = xp.broadcast_to(xp.eye(4, dtype=joints.dtype), (*joints.shape[:-1], 4, 4))
        return cls(joints, xp.asarray(opening, dtype=joints.dtype), nothing, nothing, joints, pose)


class Kinematics(Protocol):
    """Forward and inverse kinematics of the arm, in its base frame."""

    def pose(self, joints: Float[Array, "7"]) -> Float[Array, "4 4"]:
        """`T_base_tcp` of a configuration [rad]."""
        ...

    def reach(
        self, pose: Float[Array, "4 4"], start: Float[Array, "7"]
    ) -> tuple[Float[Array, "7"], Float[Array, ""]]:
        """The configuration next to `start` whose TCP is nearest to a pose, and its error [m]."""
        ...


class Arm(NamedTuple):
    """What a control law knows of the arm.

    Attributes:
      joints: Measured angles [rad].
      servo_lag: Damping over stiffness of the joints' servos [s], for the laws that set velocities.
      kinematics: For the laws that move the TCP.
    """

    joints: Float[Array, "*b 7"]
    servo_lag: Float[Array, "*b 7"]
    kinematics: Kinematics | None = None

    @property
    def tcp(self) -> Kinematics:
        """The kinematics, which must be there."""
        assert self.kinematics is not None, "this control law moves the TCP; it needs kinematics"
        return self.kinematics


class ControlLaw(abc.ABC):
    """Joint targets as a function of the action, the arm and a memory. Has no state of its own.

    The last number of an action is always the opening between the pads [m], 0 to 0.08; what lies
    beyond a limit counts as the limit, so ManiSkill's -1 and 1 shut and open the gripper here too.

    Attributes:
      name: As users write it.
      lower, upper: Limits of the arm's part of an action.
      moves_tcp: Whether it needs kinematics.
      sets_velocities: Whether it needs the lag of the servos.
    """

    name: ClassVar[str]
    lower: ClassVar[Float[np.ndarray, "n"]]
    upper: ClassVar[Float[np.ndarray, "n"]]
    moves_tcp: ClassVar[bool] = False
    sets_velocities: ClassVar[bool] = False

    @abc.abstractmethod
    def command(self, memory: Memory, action: Float[Array, "*b n"], arm: Arm) -> Memory:
        """The memory with new targets for the coming control step.

        Args:
          memory: As the last step left it.
          action: The arm's part, within its limits.
          arm: Now.
        """

    def start(self, opening: Float[Array, "*b"], arm: Arm) -> Memory:
        """At the start of an episode: the targets are where the robot is."""
        return Memory.at(arm.joints, opening)

    def begin(self, memory: Memory, action: Float[Array, "*b m"], arm: Arm) -> Memory:
        """Take the action of this control step.

        Args:
          memory: As the last step left it.
          action: The arm's part, then the opening.
          arm: Now.
        """
        xp = namespace(action)
        opening = xp.clip(action[..., -1], 0.0, MAX_OPENING)
        bounded = xp.clip(action[..., :-1], self.lower, self.upper)
        memory = self.command(memory._replace(opening=opening), bounded, arm)
        return memory._replace(joints=within_limits(memory.joints))

    def targets(self, memory: Memory, timestep: float) -> tuple[Float[Array, "*b 7"], Memory]:
        """Where the servos shall go in the next physics step [rad], and the memory after it.

        Args:
          memory: Before this physics step.
          timestep: Of the physics [s].
        """
        return memory.joints, memory


def within_limits(joints: Float[Array, "*b 7"]) -> Float[Array, "*b 7"]:
    """The nearest angles [rad] that the joints can take."""
    return namespace(joints).clip(joints, *POSITION_LIMITS.T)
