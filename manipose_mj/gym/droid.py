"""DROID's names of observations, and its sign of the gripper: what openpi's DROID policies and RoboArena's speak.

Joint angles [rad], the gripper from 0 (open) to 1 (shut), pictures of one exterior and of the wrist's camera, the instruction
as `prompt`. The last number of an action is the gripper in the same way; all others stay as they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from manipose_mj.assets.franka_hand import MAX_OPENING


def droid_observation(features: Mapping[str, Any]) -> dict[str, Any]:
    """The features under DROID's names.

    Args:
      features: With `agent_pos`, both pictures and the instruction.
    """
    agent = np.asarray(features["agent_pos"], float)
    rotation = np.stack([agent[11:14], agent[14:17], np.cross(agent[11:14], agent[14:17])], axis=1)
    turns = Rotation.from_matrix(rotation).as_euler("xyz")
    return {
        "observation/exterior_image_1_left": features["pixels/front"],
        "observation/wrist_image_left": features["pixels/wrist"],
        "observation/joint_position": agent[:7].astype(np.float32),
        "observation/gripper_position": np.array([1 - agent[7] / MAX_OPENING], np.float32),
        "observation/cartesian_position": np.concatenate([agent[8:11], turns]).astype(np.float32),
        "prompt": features["instruction"],
    }


def from_droid(actions: Float[np.ndarray, "t n"]) -> Float[np.ndarray, "t n"]:
    """Actions with the gripper's opening [m] as their last number."""
    openings = (1 - actions[:, -1:]) * MAX_OPENING
    return np.concatenate([actions[:, :-1], openings], axis=1)
