"""Control modes: eleven ways to command the arm, all on the same servos, and `primitive`."""

from __future__ import annotations

from collections.abc import Callable

from manipose_mj.control.modes.joint_position import JointDelta, JointTargetDelta
from manipose_mj.control.modes.joint_velocity import (
    JointDeltaVelocity,
    JointPositionVelocity,
    JointVelocity,
)
from manipose_mj.control.modes.tcp_motion import (
    TcpDelta,
    TcpPose,
    TcpPositionDelta,
    TcpTargetDelta,
    TcpTargetPositionDelta,
)
from manipose_mj.errors import unknown_name
from manipose_mj.tasks.action_mode import ActionMode, JointPositions

_MODES: dict[str, Callable[[], ActionMode]] = {
    mode.name: mode
    for mode in (
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
CONTROL_MODES: tuple[str, ...] = tuple(_MODES)


def control_mode(name: str) -> ActionMode:
    """A new control mode; every environment needs one of its own.

    Raises:
      InputError: There is none of that name; the nearest names are offered.
    """
    if name not in _MODES:
        raise unknown_name("control mode", name, CONTROL_MODES)
    return _MODES[name]()
