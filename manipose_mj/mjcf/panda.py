"""The Franka Emika Panda with its hand, as a composer entity that needs no downloaded file.

Visual meshes of MuJoCo Menagerie replace the drawn primitives where they are at hand; every body
has an explicit inertia and only group 3 collides, so they change nothing but the picture.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer.observation import observable
from jaxtyping import Float, Int

from manipose_mj.errors import unknown_name
from manipose_mj.mjcf import panda_geometry as geometry
from manipose_mj.mjcf import panda_menagerie as menagerie
from manipose_mj.mjcf.panda_kinematics import (
    ACCELERATION_LIMITS,
    DH,
    FINGER_OFFSET,
    FINGER_SPEED,
    FLANGE_OFFSET,
    GRIP_FORCE,
    HAND_YAW,
    HOME,
    INERTIALS,
    MAX_OPENING,
    POSITION_LIMITS,
    TCP_OFFSET,
    TORQUE_LIMITS,
    VELOCITY_LIMITS,
)

__all__ = [
    "ACCELERATION_LIMITS",
    "GRIP_FORCE",
    "HOME",
    "MAX_OPENING",
    "POSITION_LIMITS",
    "TORQUE_LIMITS",
    "VELOCITY_LIMITS",
    "Panda",
    "PandaObservables",
]

Visuals = Literal["auto", "primitive", "menagerie"]

# Servo gains [N m/rad], damping [N m s/rad], joint damping and armature: MuJoCo Menagerie.
_STIFFNESS = (4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0)
_DAMPING = (450.0, 450.0, 350.0, 350.0, 200.0, 200.0, 200.0)
_JOINT_DAMPING = 1.0
_ARMATURE = 0.1

# The grip reaches its full force on objects thicker than 70 N / 14 kN/m = 5 mm.
_GRIPPER_STIFFNESS = 14000.0  # [N/m] of the opening
# At full force a free finger travels at the data sheet's speed.
_FINGER_DAMPING = GRIP_FORCE / FINGER_SPEED  # [N s/m]

# Sliding: silicone rubber on dry plastic, card or paint is 0.8 to 1.2. Torsion [m]: two thirds of
# the radius of a 7 mm contact patch, which the model's contact points do not have.
_PAD_FRICTION = (1.0, 0.005, 0.0001)

# The chain's capsules reach into each other around a joint; these pairs cannot touch in reality.
_EXCLUDED = (
    ("link0", "link1"),
    ("link5", "link7"),
    ("left_finger", "right_finger"),
)


class Panda(composer.Entity):
    """A Panda arm and hand, gravity-compensated, under joint position control.

    The base frame is link 0's: z up through joint 1, x forwards. Controls are seven joint angles
    [rad] and the opening between the pads [m]. Contacts of the pads use the pads' own friction and
    stiffness, whatever they touch.
    """

    def _build(self, visuals: Visuals = "auto", name: str = "panda") -> None:
        """Builds the robot.

        Args:
            visuals: "primitive" draws capsules and boxes; "menagerie" draws Menagerie's meshes;
                "auto" takes the meshes where they are on this machine.
            name: the model's name, which prefixes every element of a scene.

        Raises:
            InputError: `visuals` is none of these, or "menagerie" was asked for and is not there.
        """
        if visuals not in ("auto", "primitive", "menagerie"):
            raise unknown_name("visuals", visuals, ("auto", "primitive", "menagerie"))
        self._model = mjcf.RootElement(model=name)
        self._model.compiler.angle = "radian"
        self._model.compiler.autolimits = True
        self._add_defaults()
        self._add_chain()
        self._add_hand()
        for body1, body2 in _EXCLUDED:
            self._model.contact.add("exclude", body1=body1, body2=body2)
        self._add_collision()
        self._add_actuators()
        if visuals == "primitive":
            folder = None
        elif visuals == "menagerie":
            folder = menagerie.require_menagerie_panda()
        else:
            folder = menagerie.find_menagerie_panda()
        for material, rgba in geometry.MATERIALS.items():
            self._model.asset.add(
                "material", name=material, rgba=rgba, specular=0.5, shininess=0.25
            )
        if folder is None:
            self._add_primitive_visuals()
        else:
            for mesh in menagerie.visual_meshes(folder):
                self._model.asset.add("mesh", name=mesh.file.stem, file=str(mesh.file)) if (
                    self._model.find("mesh", mesh.file.stem) is None
                ) else None
                self._body(mesh.body).add(
                    "geom",
                    dclass="visual",
                    type="mesh",
                    mesh=mesh.file.stem,
                    material=mesh.material,
                )

    def _build_observables(self) -> PandaObservables:
        return PandaObservables(self)

    def _body(self, name: str) -> mjcf.Element:
        return self._model.find("body", name)

    def _add_defaults(self) -> None:
        default = self._model.default
        visual = default.add("default", dclass="visual").geom
        visual.set_attributes(group=2, contype=0, conaffinity=0, mass=0)
        collision = default.add("default", dclass="collision").geom
        collision.set_attributes(group=3, mass=0, rgba=(0.9, 0.4, 0.2, 0.5))
        pad = default.add("default", dclass="pad").geom
        pad.set_attributes(group=3, mass=0, rgba=(0.2, 0.8, 0.3, 0.7), friction=_PAD_FRICTION)
        # Priority 1: the pads' values hold whatever they touch.
        pad.set_attributes(
            priority=1, condim=4, solref=(0.004, 1.0), solimp=(0.95, 0.99, 0.001, 0.5, 2)
        )

    def _add_body(self, parent: mjcf.Element, name: str, **pose: object) -> mjcf.Element:
        body = parent.add("body", name=name, gravcomp=1, **pose)
        mass, centre, inertia = INERTIALS[name]
        body.add("inertial", mass=mass, pos=centre, fullinertia=inertia)
        return body

    def _add_chain(self) -> None:
        body = self._add_body(self._model.worldbody, "link0")
        self._joints = []
        for i, (a, d, alpha) in enumerate(DH, start=1):
            body = self._add_body(
                body,
                f"link{i}",
                pos=(a, -d * np.sin(alpha), d * np.cos(alpha)),
                quat=(np.cos(alpha / 2), np.sin(alpha / 2), 0.0, 0.0),
            )
            joint = body.add(
                "joint",
                name=f"joint{i}",
                type="hinge",
                axis=(0, 0, 1),
                range=POSITION_LIMITS[i - 1],
                armature=_ARMATURE,
                damping=_JOINT_DAMPING,
            )
            self._joints.append(joint)

    def _add_hand(self) -> None:
        yaw = (np.cos(HAND_YAW / 2), 0.0, 0.0, np.sin(HAND_YAW / 2))
        hand = self._add_body(self._body("link7"), "hand", pos=(0, 0, FLANGE_OFFSET), quat=yaw)
        self._tcp_site = hand.add(
            "site", name="tcp", pos=(0, 0, TCP_OFFSET), size=(0.003,), rgba=(0, 0, 0, 0)
        )
        # Beside the hand and 30 deg towards the fingertips, which the hand would hide otherwise.
        tilt = np.radians(30.0)
        self._wrist_camera = hand.add(
            "camera",
            name="wrist",
            pos=(0.070, 0.0, 0.040),
            xyaxes=(0, 1, 0, np.cos(tilt), 0, np.sin(tilt)),
            fovy=75.0,
        )
        self._finger_joints = []
        for i, (name, quat) in enumerate(
            (("left_finger", (1, 0, 0, 0)), ("right_finger", (0, 0, 0, 1))), start=1
        ):
            finger = self._add_body(hand, name, pos=(0, 0, FINGER_OFFSET), quat=quat)
            joint = finger.add(
                "joint",
                name=f"finger_joint{i}",
                type="slide",
                axis=(0, 1, 0),
                range=(0.0, MAX_OPENING / 2),
                armature=_ARMATURE,
                damping=_FINGER_DAMPING,
            )
            self._finger_joints.append(joint)
        self._model.equality.add(
            "joint",
            joint1=self._finger_joints[0],
            joint2=self._finger_joints[1],
            solref=(0.005, 1.0),
            solimp=(0.95, 0.99, 0.001, 0.5, 2),
        )

    def _add_collision(self) -> None:
        for body, capsules in geometry.CAPSULES.items():
            for ends, radius in capsules:
                self._body(body).add(
                    "geom", dclass="collision", type="capsule", fromto=ends, size=(radius,)
                )
        for body, boxes in geometry.BOXES.items():
            for low, high in boxes:
                self._body(body).add("geom", dclass="collision", **_box(low, high))
        self._pad_geoms = []
        for finger in ("left_finger", "right_finger"):
            for low, high in geometry.FINGER_BOXES:
                self._body(finger).add("geom", dclass="collision", **_box(low, high))
            pad = self._body(finger).add(
                "geom", name=f"{finger}_pad", dclass="pad", **_box(*geometry.PAD_BOX)
            )
            self._pad_geoms.append(pad)

    def _add_actuators(self) -> None:
        self._actuators = []
        for i, joint in enumerate(self._joints):
            actuator = self._model.actuator.add(
                "general",
                name=f"actuator{i + 1}",
                joint=joint,
                ctrlrange=POSITION_LIMITS[i],
                forcerange=(-TORQUE_LIMITS[i], TORQUE_LIMITS[i]),
                biastype="affine",
                gainprm=(_STIFFNESS[i],),
                biasprm=(0.0, -_STIFFNESS[i], -_DAMPING[i]),
            )
            self._actuators.append(actuator)
        opening = self._model.tendon.add("fixed", name="opening")
        for joint in self._finger_joints:
            opening.add("joint", joint=joint, coef=1.0)
        # A coefficient of one hands the whole tendon force to each finger.
        self._gripper_actuator = self._model.actuator.add(
            "general",
            name="gripper",
            tendon=opening,
            ctrlrange=(0.0, MAX_OPENING),
            forcerange=(-GRIP_FORCE, GRIP_FORCE),
            biastype="affine",
            gainprm=(_GRIPPER_STIFFNESS,),
            biasprm=(0.0, -_GRIPPER_STIFFNESS, 0.0),
        )

    def _add_primitive_visuals(self) -> None:
        for body, primitives in geometry.VISUALS.items():
            for kind, numbers, material in primitives:
                if kind == "box":
                    shape = _box(numbers[:3], numbers[3:])
                elif kind == "ellipsoid":
                    shape = {"type": kind, "pos": numbers[:3], "size": numbers[3:]}
                else:
                    shape = {"type": kind, "fromto": numbers[:6], "size": numbers[6:]}
                self._body(body).add("geom", dclass="visual", material=material, **shape)

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
        return self._tcp_site

    @property
    def wrist_camera(self) -> mjcf.Element:
        """The camera on the hand; its image's up is the hand's +x."""
        return self._wrist_camera

    @property
    def pad_geoms(self) -> list[mjcf.Element]:
        """The left (+y) and the right pad."""
        return self._pad_geoms

    @property
    def gripper_geoms(self) -> list[mjcf.Element]:
        """The collision geoms of the hand and the fingers, pads included."""
        bodies = ("hand", "left_finger", "right_finger")
        return [geom for geom in self.robot_geoms if geom.parent.name in bodies]

    @property
    def robot_geoms(self) -> list[mjcf.Element]:
        """Every collision geom of the robot."""
        geoms = self._model.find_all("geom")
        return [geom for geom in geoms if geom.dclass.dclass in ("collision", "pad")]

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
            raise ValueError(
                f"joint{i + 1} = {joints[i]:.4f} rad is outside [{low[i]}, {high[i]}]"
            )
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
        physics.bind(self._actuators).ctrl = np.clip(joints, *POSITION_LIMITS.T)
        physics.bind(self._gripper_actuator).ctrl = np.clip(opening, 0.0, MAX_OPENING)

    def configuration(self, physics: mjcf.Physics) -> tuple[Float[np.ndarray, "7"], float]:
        """The joint angles [rad] and the opening [m] now."""
        joints = np.array(physics.bind(self._joints).qpos)
        return joints, float(np.sum(physics.bind(self._finger_joints).qpos))

    def tcp_pose(self, physics: mjcf.Physics) -> Float[np.ndarray, "4 4"]:
        """The tool centre point's pose in the world frame."""
        site = physics.bind(self._tcp_site)
        pose = np.eye(4)
        pose[:3, :3] = np.reshape(site.xmat, (3, 3))
        pose[:3, 3] = site.xpos
        return pose


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
        return observable.Generic(self._tcp_position_quaternion)

    def _tcp_position_quaternion(self, physics: mjcf.Physics) -> Float[np.ndarray, "7"]:
        pose = self._entity.tcp_pose(physics)
        quaternion = np.empty(4)
        mjbindings.mjlib.mju_mat2Quat(quaternion, np.ascontiguousarray(pose[:3, :3]).ravel())
        return np.concatenate([pose[:3, 3], quaternion])


def _box(low: tuple[float, ...], high: tuple[float, ...]) -> dict[str, object]:
    low, high = np.asarray(low), np.asarray(high)
    return {"type": "box", "pos": (low + high) / 2, "size": (high - low) / 2}
