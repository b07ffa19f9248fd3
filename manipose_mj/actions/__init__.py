"""Control modes: eleven ways to command the arm, all on the same servos, and `primitive`."""

from __future__ import annotations

from manipose_mj.actions.control_law import Arm, ControlLaw, Kinematics, Memory
from manipose_mj.actions.control_mode import ControlMode, checked_action
from manipose_mj.actions.inverse import action_towards
from manipose_mj.actions.joint_position import JointDelta, JointPositions, JointTargetDelta
from manipose_mj.actions.joint_velocity import (
    JointDeltaVelocity,
    JointPositionVelocity,
    JointVelocity,
)
from manipose_mj.actions.tcp_motion import (
    TcpDelta,
    TcpPose,
    TcpPositionDelta,
    TcpTargetDelta,
    TcpTargetPositionDelta,
)
from manipose_mj.actions.tcp_search import TcpSolverConfig
from manipose_mj.actions.tcp_solver import PureTcpSolver, TcpSolver
from manipose_mj.errors import unknown_name

__all__ = [
    "CONTROL_MODES",
    "Arm",
    "ControlLaw",
    "ControlMode",
    "Kinematics",
    "Memory",
    "PureTcpSolver",
    "TcpSolver",
    "TcpSolverConfig",
    "action_towards",
    "checked_action",
    "control_law",
    "control_mode",
]

_LAWS: dict[str, type[ControlLaw]] = {
    law.name: law
    for law in (
        JointPositions,
        JointDelta,
        JointTargetDelta,
        JointVelocity,
        JointPositionVelocity,
        JointDeltaVelocity,
        TcpPose,
        TcpPositionDelta,
        TcpDelta,
        TcpTargetPositionDelta,
        TcpTargetDelta,
    )
}
CONTROL_MODES: tuple[str, ...] = tuple(_LAWS)


def control_law(name: str) -> ControlLaw:
    """What actions of a control mode mean, as pure functions.

    Raises:
      InputError: There is none of that name; the nearest names are offered.
    """
    if name not in _LAWS:
        raise unknown_name("control mode", name, CONTROL_MODES)
    return _LAWS[name]()


def control_mode(name: str) -> ControlMode:
    """A new control mode; every environment needs one of its own.

    Raises:
      InputError: There is none of that name; the nearest names are offered.
    """
    return ControlMode(control_law(name))
