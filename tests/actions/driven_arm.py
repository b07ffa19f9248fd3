"""The robot alone under a control mode, driven as a task drives it, and actions for it."""

from __future__ import annotations

import numpy as np
from dm_control import mjcf

from manipose_mj.actions import action_towards, checked_action, control_mode
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING, Panda

SUBSTEPS = 10
TIMESTEP = 0.02
SIZES = {
    "pd_joint_pos": 8,
    "pd_joint_delta_pos": 8,
    "pd_joint_target_delta_pos": 8,
    "pd_joint_vel": 8,
    "pd_joint_pos_vel": 15,
    "pd_joint_delta_pos_vel": 15,
    "pd_ee_pose": 7,
    "pd_ee_delta_pos": 4,
    "pd_ee_delta_pose": 7,
    "pd_ee_target_delta_pos": 4,
    "pd_ee_target_delta_pose": 7,
}


class Arm:
    """The robot alone, driven as a task drives it."""

    def __init__(self) -> None:
        self.robot = Panda(visuals="primitive")
        self.robot.mjcf_model.option.timestep = TIMESTEP / SUBSTEPS
        self.robot.mjcf_model.option.integrator = "implicitfast"
        self.physics = mjcf.Physics.from_mjcf_model(self.robot.mjcf_model)
        self.mode = control_mode("pd_joint_pos")

    def start(self, name: str, joints: np.ndarray = HOME) -> Arm:
        self.physics.reset()
        self.robot.set_configuration(self.physics, joints, MAX_OPENING)
        self.physics.forward()
        self.mode = control_mode(name)
        self.mode.reset(self.physics, self.robot)
        return self

    def step(self, action: np.ndarray) -> None:
        self.mode.begin(
            self.physics, self.robot, checked_action(self.mode.name, self.mode.spec().shape, action)
        )
        for _ in range(SUBSTEPS):
            joints, opening = self.mode.targets()
            self.robot.follow_targets(self.physics, np.append(joints, opening))
            self.physics.step()

    @property
    def joints(self) -> np.ndarray:
        return self.robot.configuration(self.physics)[0]

    @property
    def targets(self) -> np.ndarray:
        """Where the mode sends the joints [rad]; servos get there no faster than the joints can."""
        return self.mode.memory()[:7]

    @property
    def controls(self) -> np.ndarray:
        """What the arm's servos were sent last [rad]."""
        return np.array(self.physics.bind(self.robot.actuators).ctrl)

    @property
    def state(self) -> np.ndarray:
        return np.concatenate([self.physics.data.qpos, self.physics.data.qvel])

    def still(self) -> np.ndarray:
        """The action that goes nowhere."""
        action, arrives = action_towards(
            self.mode, self.physics, self.robot, self.joints, MAX_OPENING, TIMESTEP
        )
        assert arrives
        return action


def act(name: str, *numbers: float, opening: float = MAX_OPENING) -> np.ndarray:
    """An action of a mode whose arm part begins with these numbers; the rest is zero."""
    action = np.zeros(SIZES[name])
    action[: len(numbers)] = numbers
    action[-1] = opening
    return action
