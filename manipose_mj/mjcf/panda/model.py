"""The MJCF of the Panda, written from its published tables.

Every body has an explicit inertia and only group 3 collides, so that the visual geometry in group 2
changes nothing but the picture.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from dm_control import mjcf

from manipose_mj.assets.franka_hand import (
    FINGER_ARMATURE,
    FINGER_BOXES,
    FINGER_DAMPING,
    FINGER_OFFSET,
    GRIP_FORCE,
    GRIPPER_STIFFNESS,
    MAX_OPENING,
    PAD_BOX,
    PAD_CONDIM,
    PAD_FRICTION,
    ROBOT_SOLIMP,
    ROBOT_SOLREF,
    TCP_OFFSET,
)
from manipose_mj.assets.physics import COLLISION_GROUP, VISUAL_GROUP
from manipose_mj.mjcf.panda import geometry
from manipose_mj.mjcf.panda.kinematics import (
    DH,
    FLANGE_OFFSET,
    HAND_YAW,
    INERTIALS,
    POSITION_LIMITS,
    TORQUE_LIMITS,
    WRIST_CAMERA,
    WRIST_TILT,
)
from manipose_mj.mjcf.panda.menagerie import visual_meshes

# MuJoCo Menagerie's stiffness [N m/rad] with half its damping [N m s/rad]: critical at 2.8 kg m^2.
_STIFFNESS = (4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0)
# Damping over stiffness: how far behind its set-point a joint is at a steady speed [s].
SERVO_LAG = 0.05
_JOINT_DAMPING = 1.0
# Reflected rotor inertia [kg m^2] that Franka states for the FR3's like drives (Drake's Panda).
_ARMATURE = (0.606, 0.606, 0.462, 0.462, 0.206, 0.206, 0.206)

# Capsules of neighbouring links reach into each other around a joint.
_EXCLUDED = (("link0", "link1"), ("link5", "link7"), ("left_finger", "right_finger"))


def build_panda(name: str, menagerie: Path | None) -> mjcf.RootElement:
    """The robot's MJCF; its worldbody is the base frame: z up through joint 1, x forwards.

    Args:
        name: the model's name.
        menagerie: the folder of Menagerie's Panda, whose meshes then draw the robot.
    """
    model = mjcf.RootElement(model=name)
    model.compiler.angle = "radian"
    model.compiler.autolimits = True
    _add_defaults(model)
    _add_arm(model)
    _add_hand(model)
    _add_collision(model)
    _add_actuators(model)
    for material, rgba in geometry.MATERIALS.items():
        model.asset.add("material", name=material, rgba=rgba, specular=0.5, shininess=0.25)
    if menagerie is None:
        _add_primitive_visuals(model)
    else:
        _add_mesh_visuals(model, menagerie)
    return model


def _add_defaults(model: mjcf.RootElement) -> None:
    visual = model.default.add("default", dclass="visual")
    visual.geom.set_attributes(group=VISUAL_GROUP, contype=0, conaffinity=0, mass=0)
    collision = model.default.add("default", dclass="collision")
    collision.geom.set_attributes(group=COLLISION_GROUP, mass=0, rgba=(0.9, 0.4, 0.2, 1.0))
    # These values, whatever it hits.
    collision.geom.set_attributes(solref=ROBOT_SOLREF, solimp=ROBOT_SOLIMP, solmix=1000)
    pad = model.default.add("default", dclass="pad")
    pad.geom.set_attributes(group=COLLISION_GROUP, mass=0, rgba=(0.2, 0.8, 0.3, 1.0))
    # Priority 1: these values hold whatever the pads touch.
    pad.geom.set_attributes(
        priority=1,
        condim=PAD_CONDIM,
        friction=PAD_FRICTION,
        solref=ROBOT_SOLREF,
        solimp=ROBOT_SOLIMP,
    )
    arm = model.default.add("default", dclass="arm")
    arm.joint.set_attributes(type="hinge", axis=(0, 0, 1), damping=_JOINT_DAMPING)
    finger = model.default.add("default", dclass="finger")
    finger.joint.set_attributes(
        type="slide",
        axis=(0, 1, 0),
        range=(0.0, MAX_OPENING / 2),
        armature=FINGER_ARMATURE,
        damping=FINGER_DAMPING,
    )


def _add_body(parent: mjcf.Element, name: str, **pose: object) -> mjcf.Element:
    body = parent.add("body", name=name, gravcomp=1, **pose)
    mass, centre, inertia = INERTIALS[name]
    body.add("inertial", mass=mass, pos=centre, fullinertia=inertia)
    return body


def _add_arm(model: mjcf.RootElement) -> None:
    body = _add_body(model.worldbody, "link0")
    for i, (a, d, alpha) in enumerate(DH, start=1):
        body = _add_body(
            body,
            f"link{i}",
            pos=(a, -d * np.sin(alpha), d * np.cos(alpha)),
            quat=(np.cos(alpha / 2), np.sin(alpha / 2), 0.0, 0.0),
        )
        body.add(
            "joint",
            name=f"joint{i}",
            dclass="arm",
            range=POSITION_LIMITS[i - 1],
            armature=_ARMATURE[i - 1],
        )


def _add_hand(model: mjcf.RootElement) -> None:
    yaw = (np.cos(HAND_YAW / 2), 0.0, 0.0, np.sin(HAND_YAW / 2))
    hand = _add_body(model.find("body", "link7"), "hand", pos=(0, 0, FLANGE_OFFSET), quat=yaw)
    hand.add("site", name="tcp", pos=(0, 0, TCP_OFFSET), size=(0.003,), rgba=(0, 0, 0, 0))
    hand.add(
        "camera",
        name="wrist",
        pos=WRIST_CAMERA,
        xyaxes=(0, 1, 0, np.cos(WRIST_TILT), 0, np.sin(WRIST_TILT)),
        fovy=75.0,
    )
    half_turn = (0, 0, 0, 1)
    left = _add_body(hand, "left_finger", pos=(0, 0, FINGER_OFFSET))
    right = _add_body(hand, "right_finger", pos=(0, 0, FINGER_OFFSET), quat=half_turn)
    joint1 = left.add("joint", name="finger_joint1", dclass="finger")
    joint2 = right.add("joint", name="finger_joint2", dclass="finger")
    model.equality.add(
        "joint",
        joint1=joint1,
        joint2=joint2,
        solref=ROBOT_SOLREF,
        solimp=ROBOT_SOLIMP,
    )
    # Coefficients of one: the tendon's length is the opening and each finger feels its whole force.
    opening = model.tendon.add("fixed", name="opening")
    opening.add("joint", joint=joint1, coef=1.0)
    opening.add("joint", joint=joint2, coef=1.0)


def _add_collision(model: mjcf.RootElement) -> None:
    for body, capsules in geometry.CAPSULES.items():
        for i, (ends, radius) in enumerate(capsules):
            shape = {"type": "capsule", "fromto": ends, "size": (radius,)}
            name = f"{body}_capsule_{i}"
            model.find("body", body).add("geom", name=name, dclass="collision", **shape)
    for body, boxes in geometry.BOXES.items():
        for i, box in enumerate(boxes):
            name = f"{body}_box_{i}"
            model.find("body", body).add("geom", name=name, dclass="collision", **_box(*box))
    for finger in ("left_finger", "right_finger"):
        body = model.find("body", finger)
        for i, box in enumerate(FINGER_BOXES):
            body.add("geom", name=f"{finger}_box_{i}", dclass="collision", **_box(*box))
        body.add("geom", name=f"{finger}_pad", dclass="pad", **_box(*PAD_BOX))
    for body1, body2 in _EXCLUDED:
        model.contact.add("exclude", body1=body1, body2=body2)


def _add_actuators(model: mjcf.RootElement) -> None:
    for i in range(len(DH)):
        model.actuator.add(
            "general",
            name=f"actuator{i + 1}",
            joint=f"joint{i + 1}",
            ctrlrange=POSITION_LIMITS[i],
            forcerange=(-TORQUE_LIMITS[i], TORQUE_LIMITS[i]),
            biastype="affine",
            gainprm=(_STIFFNESS[i],),
            biasprm=(0.0, -_STIFFNESS[i], -SERVO_LAG * _STIFFNESS[i]),
        )
    model.actuator.add(
        "general",
        name="gripper",
        tendon="opening",
        ctrlrange=(0.0, MAX_OPENING),
        forcerange=(-GRIP_FORCE, GRIP_FORCE),
        biastype="affine",
        gainprm=(GRIPPER_STIFFNESS,),
        biasprm=(0.0, -GRIPPER_STIFFNESS, 0.0),
    )


def _add_primitive_visuals(model: mjcf.RootElement) -> None:
    for body, primitives in geometry.VISUALS.items():
        for kind, numbers, material in primitives:
            if kind == "box":
                shape = _box(numbers[:3], numbers[3:])
            elif kind == "ellipsoid":
                shape = {"type": kind, "pos": numbers[:3], "size": numbers[3:]}
            else:
                shape = {"type": kind, "fromto": numbers[:6], "size": numbers[6:]}
            model.find("body", body).add("geom", dclass="visual", material=material, **shape)


def _add_mesh_visuals(model: mjcf.RootElement, menagerie: Path) -> None:
    for body, material, file in visual_meshes(menagerie):
        if model.find("mesh", file.stem) is None:
            model.asset.add("mesh", name=file.stem, file=str(file))
        shape = {"type": "mesh", "mesh": file.stem, "material": material}
        model.find("body", body).add("geom", dclass="visual", **shape)


def _box(low: tuple[float, ...], high: tuple[float, ...]) -> dict[str, object]:
    lower, upper = np.asarray(low), np.asarray(high)
    return {"type": "box", "pos": (lower + upper) / 2, "size": (upper - lower) / 2}
