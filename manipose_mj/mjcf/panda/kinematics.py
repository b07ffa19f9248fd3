"""Published kinematics, limits and inertias of the Franka Emika Panda, and its forward kinematics.

Sources:
    Kinematics and limits: "Robot and interface specifications", Franka Control Interface
    documentation, https://frankaemika.github.io/docs/control_parameters.html (Panda).
    Arm inertias: C. Gaz, M. Cognetti, A. Oliva, P. Robuffo Giordano, A. De Luca, "Dynamic
    Identification of the Franka Emika Panda Robot With Retrieval of Feasible Parameters Using
    Penalty-Based Optimization", RA-L 4(4), 2019, as published in franka_ros and MuJoCo Menagerie.
    Hand: `manipose_mj.assets.franka_hand`.

Units are SI; joints run from the base outwards.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.franka_hand import TCP_OFFSET

# One row a joint, Craig's (modified) convention: a_{i-1} [m], d_i [m], alpha_{i-1} [rad].
DH = np.array(
    [
        [0.0, 0.333, 0.0],
        [0.0, 0.0, -np.pi / 2],
        [0.0, 0.316, np.pi / 2],
        [0.0825, 0.0, np.pi / 2],
        [-0.0825, 0.384, -np.pi / 2],
        [0.0, 0.0, np.pi / 2],
        [0.088, 0.0, np.pi / 2],
    ]
)
FLANGE_OFFSET = 0.107  # link 7 to flange along z [m]
HAND_YAW = -np.pi / 4  # flange to hand about z [rad]
# The hand's camera, hand frame [m, rad]: beside the hand, and tilted to the fingertips, which the hand would hide from
# further up. Its image's right is along y.
WRIST_CAMERA = (0.070, 0.0, 0.040)
WRIST_TILT = np.pi / 6

POSITION_LIMITS = np.array(
    [
        [-2.8973, 2.8973],
        [-1.7628, 1.7628],
        [-2.8973, 2.8973],
        [-3.0718, -0.0698],
        [-2.8973, 2.8973],
        [-0.0175, 3.7525],
        [-2.8973, 2.8973],
    ]
)  # [rad]
VELOCITY_LIMITS = np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61])  # [rad/s]
ACCELERATION_LIMITS = np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0])  # [rad/s^2]
TCP_SPEED_LIMIT = 1.7  # [m/s]
TORQUE_LIMITS = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])  # [N m]

# The TCP is at (0.45, 0, 0.35) m, pointing down, with the fingers closing along the base's y.
HOME = np.array([0.0, -0.3110, 0.0, -2.3474, 0.0, 2.0364, np.pi / 4])  # [rad]

# Body: mass [kg], centre of mass in the body frame [m], inertia about it in the body's axes
# [kg m^2] as (xx, yy, zz, xy, xz, yz).
INERTIALS = {
    "link0": (
        0.629769,
        (-0.041018, -0.00014, 0.049974),
        (0.00315, 0.00388, 0.004285, 8.2904e-7, 0.00015, 8.2299e-6),
    ),
    "link1": (
        4.970684,
        (0.003875, 0.002081, -0.04762),
        (0.70337, 0.70661, 0.009117, -0.000139, 0.006772, 0.019169),
    ),
    "link2": (
        0.646926,
        (-0.003141, -0.02872, 0.003495),
        (0.007962, 0.02811, 0.025995, -0.003925, 0.010254, 0.000704),
    ),
    "link3": (
        3.228604,
        (0.027518, 0.039252, -0.066502),
        (0.037242, 0.036155, 0.01083, -0.004761, -0.011396, -0.012805),
    ),
    "link4": (
        3.587895,
        (-0.05317, 0.104419, 0.027454),
        (0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641),
    ),
    "link5": (
        1.225946,
        (-0.011953, 0.041065, -0.038437),
        (0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229),
    ),
    "link6": (
        1.666555,
        (0.060149, -0.014117, -0.010517),
        (0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341),
    ),
    "link7": (
        0.735522,
        (0.010517, -0.004252, 0.061597),
        (0.012516, 0.010027, 0.004815, -0.000428, -0.001196, -0.000741),
    ),
    "hand": (0.73, (-0.01, 0.0, 0.03), (0.001, 0.0025, 0.0017, 0.0, 0.0, 0.0)),
    "left_finger": (0.015, (0.0, 0.0, 0.0), (2.375e-6, 2.375e-6, 7.5e-7, 0.0, 0.0, 0.0)),
    "right_finger": (0.015, (0.0, 0.0, 0.0), (2.375e-6, 2.375e-6, 7.5e-7, 0.0, 0.0, 0.0)),
}


def link_poses(joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "7 4 4"]:
    """Poses of links 1 to 7 in the base frame (Craig, Introduction to Robotics, eq. 3.6).

    Args:
        joints: joint angles [rad].
    """
    pose = np.eye(4)
    poses = []
    for index, theta in enumerate(joints):
        pose = pose @ link_step(index, theta)
        poses.append(pose)
    return np.stack(poses)


def link_step(index: int, theta: float) -> Float[np.ndarray, "4 4"]:
    """Pose of a link in the frame of the one before it, the first being 0, for its joint's angle [rad]."""
    a, d, alpha = DH[index]
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [ct, -st, 0.0, a],
            [st * ca, ct * ca, -sa, -d * sa],
            [st * sa, ct * sa, ca, d * ca],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def flange_pose(joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "4 4"]:
    """Pose of the flange in the base frame, for joint angles in radians."""
    return link_poses(joints)[-1] @ _along_z(FLANGE_OFFSET)


def hand_pose(joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "4 4"]:
    """Pose of the hand in the base frame: z out of the hand, y the closing direction."""
    c, s = np.cos(HAND_YAW), np.sin(HAND_YAW)
    yaw = np.eye(4)
    yaw[:2, :2] = [[c, -s], [s, c]]
    return flange_pose(joints) @ yaw


def tcp_pose(joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "4 4"]:
    """Pose of the tool centre point in the base frame, for joint angles in radians."""
    return hand_pose(joints) @ _along_z(TCP_OFFSET)


def _along_z(distance: float) -> Float[np.ndarray, "4 4"]:
    pose = np.eye(4)
    pose[2, 3] = distance
    return pose
