"""Does a body that is dropped in a rest pose come to rest?"""

from __future__ import annotations

import mujoco
import numpy as np

from manipose_mj.assets.asset import StablePose
from manipose_mj.assets.physics import REST_ANGULAR_SPEED, REST_LINEAR_SPEED
from manipose_mj.poses import pose_to_vector

DROP = 0.03  # [m]
SETTLE_TIME = 4.0  # in which it must come to rest [s]
REST_TIME = 0.2  # how long it must stay slower than a body at rest [s]


def dropped(model: mujoco.MjModel, pose: StablePose) -> tuple[mujoco.MjData, float]:
    """The state after a fall of 3 cm, and the time at which rest began [s], NaN if it did not come.

    Args:
      model: The object alone above the plane z = 0, with one free joint; see `rest_scene`.
      pose: To drop it in.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = pose_to_vector(pose.pose)
    data.qpos[2] += DROP
    still_since = np.nan
    for _ in range(round(SETTLE_TIME / model.opt.timestep)):
        mujoco.mj_step(model, data)
        linear, angular = speeds(data)
        if linear > REST_LINEAR_SPEED or angular > REST_ANGULAR_SPEED or not data.ncon:
            still_since = np.nan
        elif np.isnan(still_since):
            still_since = data.time
        elif data.time - still_since >= REST_TIME:
            return data, float(still_since)
    return data, float("nan")


def speeds(data: mujoco.MjData) -> tuple[float, float]:
    """Of the free body: linear [m/s] and angular [rad/s]."""
    return float(np.linalg.norm(data.qvel[:3])), float(np.linalg.norm(data.qvel[3:6]))
