"""Grasps tried in simulation: a floating hand closes, lifts and shakes, by friction alone.

The hand is `ParallelJaw`'s boxes on two coupled finger slides with the Franka hand's grip force. It
moves along straight lines only, so every grasp is tried in the hand's own frame: the object is put
where the grasp has it and gravity points where the stable pose has it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco import rollout

from manipose_mj.assets.asset import MIN_HELD, GraspSet, StablePose
from manipose_mj.assets.franka_hand import (
    FINGER_ARMATURE,
    FINGER_DAMPING,
    GRIPPER_STIFFNESS,
    PAD_CONDIM,
    PAD_FRICTION,
    ROBOT_SOLIMP,
    ROBOT_SOLREF,
    Box,
)
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.assets.physics import GRAVITY, set_physics
from manipose_mj.grasp_sampling.grasp_choice import spread_out
from manipose_mj.poses import invert, pose_to_vector, quaternion_to_rotation, rotation_angle

_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
# Of the contact solver: on nine objects slips were the same to 0.05 mm as with 1e-8.
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class TrialConfig:
    """One trial and how many there are.

    Attributes:
      timestep: [s].
      close_time: For the fingers to close and the object to settle between them [s].
      lift: [m]; lift_time: [s].
      shake: Amplitude [m]; frequency: [Hz], of one period along each axis in turn.
      slip: How far the object may have moved in the hand at the end [m]; turn: how far turned [rad].
      held: Trials stop after so many grasps that held; tried: or after so many in all.
    """

    timestep: float = 0.004
    close_time: float = 0.3
    lift: float = 0.10
    lift_time: float = 0.25
    shake: float = 0.013
    frequency: float = 5.0
    slip: float = 0.01
    turn: float = float(np.deg2rad(10.0))
    held: int = MIN_HELD
    tried: int = 60


def with_trials(
    grasps: GraspSet,
    stable_poses: Sequence[StablePose],
    model_path: Path,
    *,
    gripper: ParallelJaw | None = None,
    config: TrialConfig | None = None,
) -> GraspSet:
    """The grasps with the outcome of trials: those that held first, those that failed left out.

    Tried are the best ones of every side first. Where too many have failed for the object to be
    called graspable, the rest is not tried.

    Args:
      grasps: Best first.
      stable_poses: Of the object, as in `grasps.clear`.
      model_path: The object's MJCF, with one free joint.
      gripper: The hand; None takes the Franka hand.
      config: The trial; None takes the published one.
    """
    config, gripper = config or TrialConfig(), gripper or ParallelJaw()
    held: list[int] = []
    failed: list[int] = []
    if len(grasps):
        trial = Trial(model_path, gripper, config)
        for k in spread_out(grasps, config.tried):
            ok = trial.run(grasps, int(k), stable_poses).held(config)
            (held if ok else failed).append(int(k))
            if len(held) == config.held or len(failed) > config.tried - MIN_HELD:
                break
    untried = np.setdiff1d(np.arange(len(grasps)), [*held, *failed])
    order = np.array([*held, *untried], int)
    return GraspSet(
        poses=grasps.poses[order],
        widths=grasps.widths[order],
        clear=grasps.clear[order],
        held=len(held),
        tried=len(held) + len(failed),
    )


@dataclass(frozen=True)
class Outcome:
    """What became of a grasp.

    Attributes:
      slip: How far the object moved in the hand from closed to the end [m]; infinite where it was dropped,
        or the open hand already touches it.
      turn: How far it turned meanwhile [rad].
      shift: How far closing itself moved the object [m].
    """

    slip: float
    turn: float
    shift: float

    def held(self, config: TrialConfig) -> bool:
        """Whether it is still where it was when the hand had closed."""
        return self.slip < config.slip and self.turn < config.turn


class Trial:
    """One object and the hand, compiled once for all of the object's grasps."""

    def __init__(self, model_path: Path, gripper: ParallelJaw, config: TrialConfig) -> None:
        self._gripper, self._config = gripper, config
        self._model = _model(model_path, gripper, config.timestep)
        self._data = mujoco.MjData(self._model)

    def run(self, grasps: GraspSet, k: int, stable_poses: Sequence[StablePose]) -> Outcome:
        """Close, lift and shake grasp `k`.

        Gravity is that of the first stable pose in which the grasp is clear of the support, or of
        the first of all. It is off while the hand closes, as a table would carry the weight.
        """
        model, data, config = self._model, self._data, self._config
        body, hand, fingers = slice(0, 7), slice(7, 10), slice(10, 12)  # of qpos: see _model
        clear = np.flatnonzero(grasps.clear[k])
        start, width = invert(grasps.poses[k]), float(grasps.widths[k])
        up = start[:3, :3] @ stable_poses[int(clear[0]) if len(clear) else 0].rotation[2]
        mujoco.mj_resetData(model, data)
        data.qpos[body] = pose_to_vector(start)
        data.qpos[fingers] = float(self._gripper.opening(width)) / 2
        mujoco.mj_forward(model, data)
        if data.ncon and data.contact.dist.min() < 0:
            return Outcome(np.inf, np.inf, np.inf)
        model.opt.gravity[:] = 0
        mujoco.mj_step(model, data, round(config.close_time / config.timestep))
        closed = data.qpos[body].copy()
        model.opt.gravity[:] = -GRAVITY * up
        targets = _motion(up, config)
        control = np.zeros((len(targets), model.nu))
        control[:, :3] = targets
        state = np.empty(mujoco.mj_stateSize(model, _STATE))
        mujoco.mj_getState(model, data, state, _STATE)
        (states,), _ = rollout.rollout(
            model, data, state[None], control[None], initial_warmstart=data.qacc_warmstart[None]
        )
        poses = states[:, 1:]  # after the time
        offsets = poses[:, body][:, :3] - poses[:, hand] - closed[:3]
        if np.abs(offsets).max() > 2 * config.slip:
            return Outcome(np.inf, np.inf, np.inf)  # dropped
        turned = rotation_angle(
            quaternion_to_rotation(poses[-1, body][3:]), quaternion_to_rotation(closed[3:])
        )
        shift = np.linalg.norm(closed[:3] - start[:3, 3])
        return Outcome(float(np.linalg.norm(offsets[-1])), float(turned), float(shift))


def _motion(up: Float[np.ndarray, "3"], config: TrialConfig) -> Float[np.ndarray, "steps 3"]:
    """Where the hand should be at each step: up by a smooth ramp, then to and fro along x, y, z."""
    times = np.arange(1, round(config.lift_time / config.timestep) + 1) * config.timestep
    share = times / config.lift_time
    ramp = config.lift * (share - np.sin(2 * np.pi * share) / (2 * np.pi))
    times = np.arange(1, round(1 / config.frequency / config.timestep) + 1) * config.timestep
    wave = config.shake * np.sin(2 * np.pi * config.frequency * times)
    parts = [ramp[:, None] * up]
    parts += [config.lift * up + wave[:, None] * axis for axis in np.eye(3)]
    return np.concatenate(parts)


def _model(path: Path, gripper: ParallelJaw, timestep: float) -> mujoco.MjModel:
    """The asset's own model with the hand beside it; the object's joint comes first.

    No asset has names with a `/`.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    set_physics(spec.option, timestep)
    spec.option.tolerance = _TOLERANCE
    hand = spec.worldbody.add_body(name="trial/hand", gravcomp=1)
    slide = mujoco.mjtJoint.mjJNT_SLIDE
    for axis, direction in zip("xyz", np.eye(3), strict=True):
        hand.add_joint(name=f"trial/hand_{axis}", type=slide, axis=direction)
    for low, high in np.array(gripper.hand):
        _add_box(hand, low, high, mass=0.3)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        finger = hand.add_body(name=f"trial/{side}", gravcomp=1)
        finger.add_joint(
            name=f"trial/finger_{side}",
            type=slide,
            axis=[0, sign, 0],
            range=[0, gripper.max_opening / 2],
            limited=True,
            damping=FINGER_DAMPING,
            # Above damping times this time step; see `FINGER_ARMATURE`.
            armature=max(FINGER_ARMATURE, 1.07 * FINGER_DAMPING * timestep),
        )
        for low, high in np.sort(_outer(gripper.finger) * [sign, sign, 1], axis=1):
            _add_box(finger, low, high, mass=0.02)
    fingers = spec.add_equality(
        type=mujoco.mjtEq.mjEQ_JOINT,
        name1="trial/finger_left",
        name2="trial/finger_right",
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
    )
    fingers.data[:2] = (0.0, 1.0)
    fingers.solref = ROBOT_SOLREF
    for axis in "xyz":
        servo = spec.add_actuator(target=f"trial/hand_{axis}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=40000.0, dampratio=1.0)
    for side in ("left", "right"):
        servo = spec.add_actuator(target=f"trial/finger_{side}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(
            kp=2 * GRIPPER_STIFFNESS
        )  # towards shut; a finger has half the opening
        servo.forcelimited, servo.forcerange = True, [-gripper.grip_force, gripper.grip_force]
    return spec.compile()


def _outer(boxes: Sequence[Box]) -> Float[np.ndarray, "b 2 3"]:
    """The boxes, with those that lie one behind the other along the closing direction made one."""
    seen: dict[tuple[float, ...], list[Box]] = {}
    for low, high in boxes:
        seen.setdefault((low[0], low[2], high[0], high[2]), []).append((low, high))
    return np.array(
        [(np.min([b[0] for b in row], 0), np.max([b[1] for b in row], 0)) for row in seen.values()]
    )


def _add_box(body: mujoco.MjsBody, low: np.ndarray, high: np.ndarray, mass: float) -> None:
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=(low + high) / 2,
        size=(high - low) / 2,
        mass=mass,
        contype=2,
        conaffinity=1,
        condim=PAD_CONDIM,
        priority=1,
        friction=PAD_FRICTION,
        solref=ROBOT_SOLREF,
        solimp=ROBOT_SOLIMP,
    )
