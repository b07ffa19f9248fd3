"""Turning joint paths and gripper commands into actions, one per control step."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from manipose_mj.control.perception.protocol import Perception
from manipose_mj.control.scene.scene_estimate import SceneEstimate

Action = Float[np.ndarray, "8"]
Actions = Iterator[Action]

_CONVERGED = 0.0015  # of every joint to its target [rad]
_MAX_SETTLE = 0.6  # [s]
_STILL = 2e-4  # change of the opening in a control step that counts as none [m]
_MAX_CLOSING = 1.6  # [s]; the fingers need 0.8 for their whole stroke
_RELAXED = 0.06  # [s]
_SQUEEZE = 0.15  # for the grip force to build up [s]


class Executor:
    """Remembers the last command and yields the next ones; reads proprioception in between."""

    def __init__(
        self, perception: Perception, timestep: float, command: Action | None = None
    ) -> None:
        """Goes on from the last `command`, or from the robot as it is; control steps are `timestep` [s]."""
        self._perception = perception
        self.timestep = timestep
        joints, opening = perception.robot()
        self._joints = joints if command is None else command[:7]
        self._opening = opening if command is None else float(command[7])

    def observe(self) -> SceneEstimate:
        """A fresh estimate."""
        return self._perception.observe()

    def hold(self, name: str | None) -> None:
        """Tell the perception what the hand holds from now on; None: nothing."""
        self._perception.hold(name)

    @property
    def feels_joints(self) -> bool:
        """Whether parts are led by what the hand feels."""
        return self._perception.feels_joints

    def joints(self) -> Float[np.ndarray, "7"]:
        """Of the arm, as they are [rad]."""
        return self._perception.robot()[0]

    def opening(self) -> float:
        """Of the gripper, as it is [m]."""
        return self._perception.robot()[1]

    def feel(self, name: str, path: Float[np.ndarray, "n 4 4"], stopped: bool) -> None:
        """Tell the perception which way a part went, by `T_world_tcp`, and whether it went no further."""
        self._perception.feel(name, path, stopped)

    def pushed(self, name: str, opening: float) -> None:
        """Tell the perception where a part was pushed to [m or rad]."""
        self._perception.pushed(name, opening)

    def relax(self) -> Actions:
        """Have the arm stay where it is, whatever it was sent to."""
        self._joints = self.joints()
        yield from self.wait(_RELAXED)

    def send(self, target: Float[np.ndarray, "7"]) -> Action:
        """The action towards joint targets [rad]."""
        self._joints = target
        return self.command

    @property
    def command(self) -> Action:
        """The action that changes nothing."""
        return np.append(self._joints, self._opening)

    def follow(self, targets: Float[np.ndarray, "t 7"]) -> Actions:
        """Send these joint targets, then wait for the arm to arrive."""
        for target in targets:
            self._joints = target
            yield self.command
        for _ in range(round(_MAX_SETTLE / self.timestep)):
            if np.abs(self._perception.robot()[0] - self._joints).max() < _CONVERGED:
                return
            yield self.command

    def wait(self, duration: float) -> Actions:
        """Hold still for a while [s]."""
        for _ in range(round(duration / self.timestep)):
            yield self.command

    def open_to(self, opening: float) -> Actions:
        """Open the gripper and wait until it is open or stops opening."""
        self._opening = opening
        yield from self._until_still()

    def close(self) -> Actions:
        """Close with full force and wait until the fingers have stopped."""
        self._opening = 0.0
        yield from self._until_still()
        yield from self.wait(_SQUEEZE)

    def _until_still(self) -> Actions:
        before = np.inf
        for step in range(round(_MAX_CLOSING / self.timestep)):
            yield self.command
            now = self._perception.robot()[1]
            if step > 5 and abs(now - before) < _STILL:
                return
            before = now
