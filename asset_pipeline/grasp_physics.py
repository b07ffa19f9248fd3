"""Do grasps hold? A floating hand closes on the object, lifts it and shakes it, by friction alone.

The hand is `ParallelJaw`'s boxes on two coupled finger slides with the Franka hand's grip force. It
moves along straight lines only, so every grasp is tried in the hand's own frame: the object is put
where the grasp has it and gravity points where the stable pose has it.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
from jaxtyping import Float, Int

from asset_pipeline.assets import GraspSet, StablePose
from asset_pipeline.emit import model_element
from asset_pipeline.geometry import Body
from asset_pipeline.gripper import ParallelJaw
from manipose_mj.poses import (
    invert,
    pose_to_vector,
    quaternion_to_rotation,
    rotation_angle,
)

GRIP_FORCE = 70.0  # [N], on each pad: Franka hand data sheet, continuous
PAD_FRICTION = "1 0.005 0.0001"
FINGER_DAMPING = 1400.0  # [N s/m]: a free finger moves at the data sheet's 0.05 m/s
# Reflected mass of the drive [kg]; a lighter one lets the grip force chatter at this time step.
FINGER_ARMATURE = 3.0
TIMESTEP = 0.002
CLOSE_TIME, LIFT_TIME, SHAKE_TIME = 0.4, 0.4, 0.34
LIFT = 0.15  # [m]
SHAKE = 0.03, 3.0  # amplitude [m] and frequency [Hz]: 1.1 g at its peak, along each axis in turn


@dataclass(frozen=True)
class HoldResult:
    """What became of each grasp.

    Attributes:
      slip: `(n,)` [m], how far the object moved in the hand from closed to the end.
      turn: `(n,)` [rad], how far it turned meanwhile.
      shift: `(n,)` [m], how far closing itself moved the object.
    """

    slip: Float[np.ndarray, "n"]
    turn: Float[np.ndarray, "n"]
    shift: Float[np.ndarray, "n"]

    @property
    def held(self) -> np.ndarray:
        """`(n,)`: within 1 cm and 10 degrees of where it was when the hand had closed."""
        return (self.slip < 0.01) & (self.turn < np.deg2rad(10))


def hold(
    body: Body,
    grasps: GraspSet,
    stable_poses: tuple[StablePose, ...],
    index: Int[np.ndarray, "n"],
    gripper: ParallelJaw | None = None,
) -> HoldResult:
    """Close, lift and shake each of the grasps in `index`.

    Gravity is that of the first stable pose in which the grasp is clear of the support, or of the
    first of all. It is off while the hand closes, as a table would carry the weight.
    """
    gripper = gripper or ParallelJaw()
    model = _model(body, gripper)
    data = mujoco.MjData(model)
    rows = []
    for k in index:
        poses = np.flatnonzero(grasps.clear[k])
        up_object = stable_poses[int(poses[0]) if len(poses) else 0].rotation[2]
        rows.append(_hold_one(model, data, grasps.poses[k], grasps.widths[k], up_object, gripper))
    return HoldResult(*np.array(rows, float).reshape(-1, 3).T)


def _hold_one(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    grasp: Float[np.ndarray, "4 4"],
    width: float,
    up_object: Float[np.ndarray, "3"],
    gripper: ParallelJaw,
) -> tuple[float, float, float]:
    mujoco.mj_resetData(model, data)
    start = invert(grasp)
    up = start[:3, :3] @ up_object
    data.qpos[3:5] = float(gripper.opening(width)) / 2
    data.qpos[5:12] = pose_to_vector(start)
    data.ctrl[3:5] = -1.0
    model.opt.gravity[:] = 0
    steps = round(CLOSE_TIME / TIMESTEP)
    mujoco.mj_step(model, data, steps)
    closed = data.qpos[5:12].copy()
    shift = float(np.linalg.norm(closed[:3] - start[:3, 3]))
    model.opt.gravity[:] = -9.81 * up
    for target in _motion(up):
        data.ctrl[:3] = target
        mujoco.mj_step(model, data)
    offset = data.qpos[5:8] - data.qpos[:3] - closed[:3]
    turned = rotation_angle(
        quaternion_to_rotation(data.qpos[8:12]), quaternion_to_rotation(closed[3:])
    )
    return float(np.linalg.norm(offset)), float(turned), shift


def _motion(up: Float[np.ndarray, "3"]) -> Float[np.ndarray, "steps 3"]:
    """Where the hand should be at each step: up by a smooth ramp, then to and fro along x, y, z."""
    lift = np.arange(round(LIFT_TIME / TIMESTEP)) * TIMESTEP / LIFT_TIME
    ramp = LIFT * (lift - np.sin(2 * np.pi * lift) / (2 * np.pi))
    amplitude, frequency = SHAKE
    times = np.arange(round(SHAKE_TIME / TIMESTEP)) * TIMESTEP
    wave = amplitude * np.sin(2 * np.pi * frequency * times)
    parts = [ramp[:, None] * up]
    parts += [LIFT * up + wave[:, None] * axis for axis in np.eye(3)]
    return np.concatenate(parts)


def _model(body: Body, gripper: ParallelJaw) -> mujoco.MjModel:
    with tempfile.TemporaryDirectory() as folder:
        root = model_element(body.name, (replace(body, visual=()),), Path(folder))
        option = ElementTree.SubElement(root, "option", cone="elliptic", impratio="10")
        option.set("timestep", str(TIMESTEP))
        option.set("integrator", "implicitfast")
        option.set("noslip_iterations", "10")
        world = root.find("worldbody")
        assert world is not None
        world.insert(0, _hand(gripper))  # before the object, so that its joints come first
        equality = ElementTree.SubElement(root, "equality")
        ElementTree.SubElement(
            equality, "joint", joint1="finger_left", joint2="finger_right", solref="0.005 1"
        )
        actuator = ElementTree.SubElement(root, "actuator")
        for axis in "xyz":
            ElementTree.SubElement(
                actuator, "position", joint=f"hand_{axis}", kp="40000", dampratio="1"
            )
        for side in ("left", "right"):
            ElementTree.SubElement(
                actuator, "motor", joint=f"finger_{side}", gear=str(GRIP_FORCE)
            )
        path = Path(folder) / "hold.xml"
        ElementTree.ElementTree(root).write(path, encoding="unicode")
        return mujoco.MjModel.from_xml_path(str(path))


def _hand(gripper: ParallelJaw) -> ElementTree.Element:
    hand = ElementTree.Element("body", name="hand", gravcomp="1")
    for axis, direction in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True):
        ElementTree.SubElement(hand, "joint", name=f"hand_{axis}", type="slide", axis=direction)
    for low, high in gripper.hand:
        _box(hand, low, high, mass=1.0)
    for side, sign in (("left", 1), ("right", -1)):
        finger = ElementTree.SubElement(hand, "body", name=side, gravcomp="1")
        ElementTree.SubElement(
            finger,
            "joint",
            name=f"finger_{side}",
            type="slide",
            axis=f"0 {sign} 0",
            range=f"0 {gripper.max_opening / 2}",
            damping=str(FINGER_DAMPING),
            armature=str(FINGER_ARMATURE),
        )
        for low, high in sign_boxes(gripper, sign):
            _box(finger, low, high, mass=0.02)
    return hand


def sign_boxes(gripper: ParallelJaw, sign: int) -> Float[np.ndarray, "boxes 2 3"]:
    """The boxes of the finger on one side, measured from its pad's face."""
    return np.sort(np.array(gripper.finger) * [sign, sign, 1], axis=1)


def _box(parent: ElementTree.Element, low, high, mass: float) -> None:
    low, high = np.asarray(low), np.asarray(high)
    ElementTree.SubElement(
        parent,
        "geom",
        type="box",
        pos=" ".join(map(str, (low + high) / 2)),
        size=" ".join(map(str, (high - low) / 2)),
        mass=str(mass),
        contype="2",
        conaffinity="1",
        condim="4",
        priority="1",
        friction=PAD_FRICTION,
        solref="0.004 1",
        solimp="0.95 0.99 0.001",
    )
