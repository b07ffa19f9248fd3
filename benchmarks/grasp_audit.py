"""Do sampled grasps hold? A floating hand closes on each, lifts it and shakes it, by friction alone.

    python benchmarks/grasp_audit.py FOLDER_OF_ASSETS [--name NAME ...] [--top 100]

The hand is `ParallelJaw`'s boxes on two coupled finger slides with the Franka hand's grip force. It
moves along straight lines only, so every grasp is tried in the hand's own frame: the object is put
where the grasp has it and gravity points where the stable pose has it.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float, Int

from asset_pipeline.asset_json import list_assets, read_asset
from asset_pipeline.assets import Asset
from asset_pipeline.gripper import ParallelJaw
from manipose_mj.poses import invert, pose_to_vector, quaternion_to_rotation, rotation_angle

# Contact, damping [N s/m] and reflected mass [kg] as in `manipose_mj.mjcf.panda_model`.
PAD_FRICTION = (1.0, 0.005, 0.0001)
PAD_SOLREF, PAD_SOLIMP = (0.005, 1.0), (0.95, 0.99, 0.001, 0.5, 2.0)
FINGER_DAMPING = 1400.0
FINGER_ARMATURE = 3.0
TIMESTEP = 0.002
CLOSE_TIME, LIFT_TIME, SHAKE_TIME = 0.5, 0.4, 0.34  # [s]
LIFT = 0.15  # [m]
SHAKE = 0.03, 3.0  # amplitude [m] and frequency [Hz]: 1.1 g at its peak, along each axis in turn


@dataclass(frozen=True)
class HoldResult:
    """What became of each grasp.

    Attributes:
      slip: `(n,)` [m], how far the object moved in the hand from closed to the end.
      turn: `(n,)` [rad], how far it turned meanwhile.
      shift: `(n,)` [m], how far closing itself moved the object.
      opening: `(n,)` [m], between the pads' faces at the end.
    """

    slip: Float[np.ndarray, "n"]
    turn: Float[np.ndarray, "n"]
    shift: Float[np.ndarray, "n"]
    opening: Float[np.ndarray, "n"]

    @property
    def held(self) -> np.ndarray:
        """`(n,)`: within 1 cm and 10 degrees of where it was when the hand had closed."""
        return (self.slip < 0.01) & (self.turn < np.deg2rad(10))


def hold(
    asset: Asset, index: Int[np.ndarray, "n"], gripper: ParallelJaw | None = None
) -> HoldResult:
    """Close, lift and shake each of the asset's grasps in `index`.

    Gravity is that of the first stable pose in which the grasp is clear of the support, or of the
    first of all. It is off while the hand closes, as a table would carry the weight.
    """
    grasps = asset.grasps
    assert grasps is not None
    gripper = gripper or ParallelJaw()
    model = _model(asset.model_path, gripper)
    data = mujoco.MjData(model)
    rows = []
    for k in index:
        poses = np.flatnonzero(grasps.clear[k])
        up_object = asset.stable_poses[int(poses[0]) if len(poses) else 0].rotation[2]
        rows.append(_hold_one(model, data, grasps.poses[k], grasps.widths[k], up_object, gripper))
    return HoldResult(*np.array(rows, float).reshape(-1, 4).T)


def _hold_one(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    grasp: Float[np.ndarray, "4 4"],
    width: float,
    up_object: Float[np.ndarray, "3"],
    gripper: ParallelJaw,
) -> tuple[float, float, float, float]:
    mujoco.mj_resetData(model, data)
    thing, fingers, hand = slice(0, 7), slice(10, 12), slice(7, 10)  # of qpos: see _model
    start = invert(grasp)
    up = start[:3, :3] @ up_object
    data.qpos[thing] = pose_to_vector(start)
    data.qpos[fingers] = float(gripper.opening(width)) / 2
    data.ctrl[3:5] = -gripper.grip_force
    model.opt.gravity[:] = 0
    mujoco.mj_step(model, data, round(CLOSE_TIME / TIMESTEP))
    closed = data.qpos[thing].copy()
    shift = float(np.linalg.norm(closed[:3] - start[:3, 3]))
    model.opt.gravity[:] = -9.81 * up
    for target in _motion(up):
        data.ctrl[:3] = target
        mujoco.mj_step(model, data)
    offset = data.qpos[thing][:3] - data.qpos[hand] - closed[:3]
    turned = rotation_angle(
        quaternion_to_rotation(data.qpos[thing][3:]), quaternion_to_rotation(closed[3:])
    )
    return float(np.linalg.norm(offset)), float(turned), shift, float(data.qpos[fingers].sum())


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


def _model(path: Path, gripper: ParallelJaw) -> mujoco.MjModel:
    """The asset's own model with the hand beside it; the object's joint comes first."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10
    spec.option.noslip_iterations = 10
    hand = spec.worldbody.add_body(name="hand", gravcomp=1)
    slide = mujoco.mjtJoint.mjJNT_SLIDE
    for axis, direction in zip("xyz", np.eye(3), strict=True):
        hand.add_joint(name=f"hand_{axis}", type=slide, axis=direction)
    for low, high in gripper.hand:
        _add_box(hand, low, high, mass=0.3)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        finger = hand.add_body(name=side, gravcomp=1)
        finger.add_joint(
            name=f"finger_{side}",
            type=slide,
            axis=[0, sign, 0],
            range=[0, gripper.max_opening / 2],
            limited=True,
            damping=FINGER_DAMPING,
            armature=FINGER_ARMATURE,
        )
        for low, high in np.sort(np.array(gripper.finger) * [sign, sign, 1], axis=1):
            _add_box(finger, low, high, mass=0.02)
    fingers = spec.add_equality(
        type=mujoco.mjtEq.mjEQ_JOINT,
        name1="finger_left",
        name2="finger_right",
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
    )
    fingers.data[:2] = (0.0, 1.0)
    fingers.solref = (0.005, 1.0)
    for axis in "xyz":
        servo = spec.add_actuator(target=f"hand_{axis}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=40000.0, dampratio=1.0)
    for side in ("left", "right"):
        spec.add_actuator(target=f"finger_{side}", trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_motor()
    return spec.compile()


def _add_box(body: mujoco.MjsBody, low: np.ndarray, high: np.ndarray, mass: float) -> None:
    low, high = np.asarray(low), np.asarray(high)
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=(low + high) / 2,
        size=(high - low) / 2,
        mass=mass,
        contype=2,
        conaffinity=1,
        condim=4,
        priority=1,
        friction=PAD_FRICTION,
        solref=PAD_SOLREF,
        solimp=PAD_SOLIMP,
    )


def main() -> None:
    """Print a line for every asset: how many of its best grasps hold."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("assets", type=Path, help="folder of asset folders")
    parser.add_argument("--name", action="append", default=[], help="only these assets")
    parser.add_argument("--top", type=int, default=100, help="grasps tried of each asset")
    arguments = parser.parse_args()
    print(f"{'asset':<28}{'grasps':>7}{'held':>9}{'slip mm':>9}{'shift mm':>9}{'seconds':>9}")
    for folder in list_assets(arguments.assets):
        asset = read_asset(folder)
        if (arguments.name and asset.name not in arguments.name) or not asset.grasps:
            continue
        start = time.perf_counter()
        result = hold(asset, np.arange(min(arguments.top, len(asset.grasps))))
        print(
            f"{asset.name:<28}{len(asset.grasps):>7}{result.held.mean():>9.1%}"
            f"{1e3 * np.median(result.slip):>9.2f}{1e3 * np.median(result.shift):>9.2f}"
            f"{time.perf_counter() - start:>9.1f}"
        )


if __name__ == "__main__":
    main()
