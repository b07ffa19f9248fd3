"""Straight motions of the TCP by differential IK (mink), one solve per control step."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import mink
import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation, Slerp

from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.motion.batch_ik import rotation_vector
from manipose_mj.mjcf.panda.kinematics import VELOCITY_LIMITS

_KEPT = 2_000  # lines that an arm remembers; a target is a kilobyte or two


@dataclass(frozen=True)
class LineConfig:
    """Attributes: speed [m/s]; turn_speed [rad/s]; velocity_share: of the joint velocity limits;
    max_lag, max_tilt: how far the arm may fall behind the line [m, rad]; settle_steps: solves to
    converge at the end; end_position, end_rotation: tolerance there [m, rad]; clearance and
    detection: of the collision-avoidance limit [m]."""

    speed: float = 0.15
    turn_speed: float = 0.8
    velocity_share: float = 0.8
    max_lag: float = 0.01
    max_tilt: float = 0.06
    settle_steps: int = 12
    end_position: float = 7e-4
    end_rotation: float = 4e-3
    clearance: float = 0.003
    detection: float = 0.02


def line_poses(
    start: Float[np.ndarray, "4 4"],
    goal: Float[np.ndarray, "4 4"],
    timestep: float,
    config: LineConfig,
) -> Float[np.ndarray, "t 4 4"]:
    """Poses along the straight line, one per control step, starting and stopping smoothly."""
    distance = float(np.linalg.norm(goal[:3, 3] - start[:3, 3]))
    turn = float(np.linalg.norm(rotation_vector((goal[:3, :3] @ start[:3, :3].T)[None])))
    # The minimum-jerk law peaks at 1.875 times its mean speed.
    duration = 1.875 * max(distance / config.speed, turn / config.turn_speed, 4 * timestep / 1.875)
    count = int(np.ceil(duration / timestep))
    tau = np.arange(1, count + 1) / count
    share = tau**3 * (10 - 15 * tau + 6 * tau**2)
    poses = np.tile(np.eye(4), (count, 1, 1))
    ends = Rotation.from_matrix(np.stack([start[:3, :3], goal[:3, :3]]))
    poses[:, :3, :3] = Slerp([0, 1], ends)(share).as_matrix()
    poses[:, :3, 3] = start[:3, 3] + share[:, None] * (goal[:3, 3] - start[:3, 3])
    return poses


def track(
    arm: ArmModel,
    joints: Float[np.ndarray, "7"],
    poses: Float[np.ndarray, "t 4 4"],
    timestep: float,
    *,
    touched_bodies: frozenset[str] = frozenset(),
    config: LineConfig | None = None,
) -> Float[np.ndarray, "k 7"] | None:
    """Joint targets that lead the TCP through `poses`; None if the arm cannot follow.

    Each step is a quadratic program: the frame task under joint position, joint velocity and
    collision-avoidance limits. Plans that fail ask for the same lines again: the arm keeps what it answered.

    Args:
      arm: The arm among its obstacles.
      joints: Where it starts [rad].
      poses: `T_world_tcp`, one per control step.
      timestep: Control step [s].
      touched_bodies: Bodies that the motion is meant to touch, left out of collision avoidance.
      config: Speeds, tolerances, clearances.
    """
    config = config or LineConfig()
    key = _digest(arm, joints, poses, repr((timestep, sorted(touched_bodies), config)))
    if key not in arm.tracks:
        if len(arm.tracks) == _KEPT:
            arm.tracks.clear()
        arm.tracks[key] = _tracked(arm, joints, poses, timestep, touched_bodies, config)
    targets = arm.tracks[key]
    return None if targets is None else targets.copy()


def _digest(
    arm: ArmModel,
    joints: Float[np.ndarray, "7"],
    poses: Float[np.ndarray, "t 4 4"],
    options: str,
) -> bytes:
    """Of all that a tracked line depends on; `ArmModel.follow` changes nothing of the model but places and turns."""
    found = hashlib.blake2b(options.encode(), digest_size=16)
    for values in (arm.model.body_pos, arm.model.body_quat, joints, poses):
        found.update(values.tobytes())
    return found.digest()


def _tracked(
    arm: ArmModel,
    joints: Float[np.ndarray, "7"],
    poses: Float[np.ndarray, "t 4 4"],
    timestep: float,
    touched_bodies: frozenset[str],
    config: LineConfig,
) -> Float[np.ndarray, "k 7"] | None:
    configuration = mink.Configuration(arm.model, q=joints)
    frame = mink.FrameTask(arm.tcp, "site", position_cost=1.0, orientation_cost=0.5)
    damping = mink.DampingTask(arm.model, cost=1e-4)
    limits = _limits(arm, touched_bodies, config)
    targets = []
    for step in range(len(poses) + config.settle_steps):
        pose = poses[min(step, len(poses) - 1)]
        frame.set_target(mink.SE3.from_matrix(pose))
        try:
            velocity = mink.solve_ik(
                configuration, [frame, damping], timestep, "daqp", limits=limits
            )
        except (mink.NoSolutionFound, mink.NotWithinConfigurationLimits):
            return None
        configuration.integrate_inplace(velocity, timestep)
        targets.append(configuration.q.copy())
        lag, tilt = _frame_error(configuration, arm.tcp, pose)
        if lag > config.max_lag or tilt > config.max_tilt:
            return None
        if step >= len(poses) - 1 and lag < config.end_position and tilt < config.end_rotation:
            return np.stack(targets)
    return None


def _limits(arm: ArmModel, touched: frozenset[str], config: LineConfig) -> list[mink.Limit]:
    names = [arm.model.joint(i).name for i in range(arm.model.njnt)]
    speeds = dict(zip(names, config.velocity_share * VELOCITY_LIMITS, strict=True))
    limits: list[mink.Limit] = [
        mink.ConfigurationLimit(arm.model),
        mink.VelocityLimit(arm.model, speeds),
    ]
    obstacles = arm.obstacle_geoms(touched)
    if obstacles:
        limits.append(
            mink.CollisionAvoidanceLimit(
                arm.model,
                [(arm.distal_geoms.tolist(), obstacles)],
                minimum_distance_from_collisions=config.clearance,
                collision_detection_distance=config.detection,
            )
        )
    return limits


def _frame_error(
    configuration: mink.Configuration, site: str, pose: Float[np.ndarray, "4 4"]
) -> tuple[float, float]:
    own = configuration.get_transform_frame_to_world(site, "site").as_matrix()
    turn = rotation_vector((pose[:3, :3] @ own[:3, :3].T)[None])
    return float(np.linalg.norm(pose[:3, 3] - own[:3, 3])), float(np.linalg.norm(turn))
