"""The Franka Emika Panda with its hand, as a composer entity that needs no downloaded file."""

from __future__ import annotations

from typing import Literal, get_args

import mujoco
import numpy as np
from dm_control import composer, mjcf
from dm_control.composer.observation import observable
from jaxtyping import Float, Int

from manipose_mj.assets.franka_hand import GRIP_FORCE, MAX_OPENING
from manipose_mj.errors import unknown_name
from manipose_mj.mjcf.panda.kinematics import (
    ACCELERATION_LIMITS,
    HOME,
    POSITION_LIMITS,
    TCP_SPEED_LIMIT,
    TORQUE_LIMITS,
    VELOCITY_LIMITS,
)
from manipose_mj.mjcf.panda.menagerie import find_menagerie_panda, require_menagerie_panda
from manipose_mj.mjcf.panda.model import build_panda
from manipose_mj.mjcf.panda.servos import ServoAddresses, Servos

__all__ = [
    "ACCELERATION_LIMITS",
    "GRIP_FORCE",
    "HOME",
    "MAX_OPENING",
    "POSITION_LIMITS",
    "TCP_SPEED_LIMIT",
    "TORQUE_LIMITS",
    "VELOCITY_LIMITS",
    "VISUALS",
    "Panda",
    "PandaObservables",
    "Visuals",
    "picture_visuals",
]

Visuals = Literal["primitive", "menagerie"]
VISUALS: tuple[Visuals, ...] = get_args(Visuals)


def picture_visuals() -> Visuals:
    """How pictures show the robot, which nothing is measured by: with Menagerie's meshes where they are on this machine.

    Raises:
        InputError: they are not where `MENAGERIE_ROOT` says.
    """
    return "primitive" if find_menagerie_panda() is None else "menagerie"


class Panda(composer.Entity):
    """A Panda arm and hand, gravity-compensated, under joint position control.

    The base frame is link 0's: z up through joint 1, x forwards. Controls are seven joint angles
    [rad] and the opening between the pads [m]. Contacts of the pads use the pads' own friction and
    stiffness, whatever they touch.
    """

    def _build(self, visuals: Visuals = "primitive", name: str = "panda") -> None:
        """Builds the robot.

        Args:
            visuals: "primitive" draws capsules and boxes; "menagerie" draws Menagerie's meshes.
            name: the model's name, which prefixes every element of a scene.

        Raises:
            InputError: `visuals` is none of these, or "menagerie" was asked for and is not there.
        """
        if visuals not in VISUALS:
            raise unknown_name("visuals", visuals, VISUALS)
        folder = require_menagerie_panda() if visuals == "menagerie" else None
        self._model = build_panda(name, folder)
        self._joints = [self._model.find("joint", f"joint{i}") for i in range(1, 8)]
        self._finger_joints = [self._model.find("joint", f"finger_joint{i}") for i in (1, 2)]
        self._actuators = [self._model.find("actuator", f"actuator{i}") for i in range(1, 8)]
        self._gripper_actuator = self._model.find("actuator", "gripper")
        self._servos: Servos | None = None

    def _build_observables(self) -> PandaObservables:
        return PandaObservables(self)

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """The robot's MJCF."""
        return self._model

    @property
    def joints(self) -> list[mjcf.Element]:
        """The seven arm joints, from the base outwards."""
        return self._joints

    @property
    def finger_joints(self) -> list[mjcf.Element]:
        """The two finger slides; each is half the opening [m]."""
        return self._finger_joints

    @property
    def actuators(self) -> list[mjcf.Element]:
        """The seven joint position servos; controls in radians."""
        return self._actuators

    @property
    def gripper_actuator(self) -> mjcf.Element:
        """The gripper's servo; its control is the opening between the pads [m]."""
        return self._gripper_actuator

    @property
    def tcp_site(self) -> mjcf.Element:
        """The tool centre point, between the pads: z the approach, y the closing direction."""
        return self._model.find("site", "tcp")

    @property
    def wrist_camera(self) -> mjcf.Element:
        """The camera on the hand; its image's up is the hand's +x."""
        return self._model.find("camera", "wrist")

    @property
    def pad_geoms(self) -> list[mjcf.Element]:
        """The left (+y) and the right pad."""
        return [self._model.find("geom", f"{side}_finger_pad") for side in ("left", "right")]

    @property
    def gripper_geoms(self) -> list[mjcf.Element]:
        """The collision geoms of the hand and the fingers, pads included."""
        bodies = ("hand", "left_finger", "right_finger")
        return [geom for geom in self.robot_geoms if geom.parent.name in bodies]

    @property
    def robot_geoms(self) -> list[mjcf.Element]:
        """Every collision geom of the robot."""
        geoms = self._model.find_all("geom")
        return [geom for geom in geoms if geom.dclass in ("collision", "pad")]

    def gripper_geom_ids(self, physics: mjcf.Physics) -> Int[np.ndarray, "geoms"]:
        """Model ids of `gripper_geoms`."""
        return np.asarray(physics.bind(self.gripper_geoms).element_id)

    def robot_geom_ids(self, physics: mjcf.Physics) -> Int[np.ndarray, "geoms"]:
        """Model ids of `robot_geoms`."""
        return np.asarray(physics.bind(self.robot_geoms).element_id)

    def set_configuration(
        self, physics: mjcf.Physics, joints: Float[np.ndarray, "7"], opening: float
    ) -> None:
        """Puts the robot at rest in a configuration, with the controls that hold it.

        Args:
            physics: the scene's physics.
            joints: joint angles [rad].
            opening: distance between the pads [m].

        Raises:
            ValueError: an angle or the opening is outside its limits.
        """
        low, high = POSITION_LIMITS.T
        for i in np.flatnonzero((joints < low - 1e-9) | (joints > high + 1e-9)):
            raise ValueError(f"joint{i + 1} = {joints[i]:.4f} rad is outside [{low[i]}, {high[i]}]")
        if not -1e-9 <= opening <= MAX_OPENING + 1e-9:
            raise ValueError(f"opening = {opening:.4f} m is outside [0, {MAX_OPENING}]")
        every_joint = physics.bind([*self._joints, *self._finger_joints])
        every_joint.qpos = np.concatenate([joints, [opening / 2, opening / 2]])
        every_joint.qvel = 0.0
        every_joint.qacc_warmstart = 0.0
        self.apply_targets(physics, joints, opening)

    def apply_targets(
        self, physics: mjcf.Physics, joints: Float[np.ndarray, "7"], opening: float
    ) -> None:
        """Writes joint angles [rad] and the opening [m] as controls, clipped to their limits."""
        at, control = self.servos(physics).at, physics.data.ptr.ctrl
        control[at.arm] = np.clip(joints, POSITION_LIMITS[:, 0], POSITION_LIMITS[:, 1])
        control[at.gripper] = min(max(opening, 0.0), MAX_OPENING)

    def follow_targets(self, physics: mjcf.Physics, target: Float[np.ndarray, "8"]) -> None:
        """Applies joint angles [rad] and an opening [m], as `Servos.follow`; before every physics step."""
        self.servos(physics).follow(target)

    def servo_lag(self, physics: mjcf.Physics) -> Float[np.ndarray, "7"]:
        """Damping over stiffness of the joints' servos [s]."""
        return self.servos(physics).lag()

    def servos(self, physics: mjcf.Physics) -> Servos:
        """The robot in a compiled model and its data, looked up once for each."""
        data = physics.data.ptr
        if self._servos is None or self._servos.data is not data:
            model = physics.model.ptr
            joints = np.array(physics.bind(self._joints).element_id)
            addresses = ServoAddresses(
                arm=_run(physics.bind(self._actuators).element_id),
                gripper=int(physics.bind(self._gripper_actuator).element_id),
                angles=_run(model.jnt_qposadr[joints]),
                dofs=_run(model.jnt_dofadr[joints]),
                fingers=_run(np.array(physics.bind(self._finger_joints).qposadr)),
                tcp=int(physics.bind(self.tcp_site).element_id),
            )
            self._servos = Servos.of(model, data, addresses)
        return self._servos

    def configuration(self, physics: mjcf.Physics) -> tuple[Float[np.ndarray, "7"], float]:
        """The joint angles [rad] and the opening [m] now."""
        at, positions = self.servos(physics).at, physics.data.ptr.qpos
        return positions[at.angles].copy(), float(positions[at.fingers].sum())

    def tcp_vector(self, physics: mjcf.Physics) -> Float[np.ndarray, "7"]:
        """The tool centre point's pose in the world frame: position [m], then quaternion wxyz, x not negative."""
        if physics.is_dirty:
            physics.forward()
        site, data = self.servos(physics).at.tcp, physics.data.ptr
        vector = np.empty(7)
        vector[:3] = data.site_xpos[site]
        mujoco.mju_mat2Quat(vector[3:], data.site_xmat[site])
        # A hand that points down is near (0, 1, 0, 0), where the sign of w would come and go.
        if vector[4] < 0:
            vector[3:] *= -1
        return vector

    def tcp_pose(self, physics: mjcf.Physics) -> Float[np.ndarray, "4 4"]:
        """The tool centre point's pose in the world frame."""
        site = physics.bind(self.tcp_site)
        pose = np.eye(4)
        pose[:3, :3] = np.reshape(site.xmat, (3, 3))
        pose[:3, 3] = site.xpos
        return pose


def _run(indices: Int[np.ndarray, "n"]) -> slice:
    """Neighbours as a slice, which is quicker to index with."""
    first = int(indices[0])
    assert list(indices) == list(range(first, first + len(indices)))
    return slice(first, first + len(indices))


class PandaObservables(composer.Observables):
    """What the robot's own sensors tell; all but the pose of the TCP is in joint space."""

    @composer.observable
    def joint_positions(self) -> observable.Observable:
        """Seven joint angles [rad]."""
        return observable.MJCFFeature("qpos", self._entity.joints)

    @composer.observable
    def joint_velocities(self) -> observable.Observable:
        """Seven joint velocities [rad/s]."""
        return observable.MJCFFeature("qvel", self._entity.joints)

    @composer.observable
    def joint_torques(self) -> observable.Observable:
        """Seven servo torques [N m]; gravity compensation is not among them."""
        return observable.MJCFFeature("force", self._entity.actuators)

    @composer.observable
    def gripper_opening(self) -> observable.Observable:
        """The distance between the pads [m], shape (1,)."""
        return observable.Generic(
            lambda physics: np.array([self._entity.configuration(physics)[1]])
        )

    @composer.observable
    def tcp_pose(self) -> observable.Observable:
        """The TCP in the world frame: position [m], then quaternion wxyz."""
        return observable.Generic(self._entity.tcp_vector)
