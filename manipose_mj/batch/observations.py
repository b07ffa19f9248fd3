"""Observations of many worlds, with the names, shapes and meaning that the CPU task's have."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from manipose_mj.batch.goals import stack_trees
from manipose_mj.batch.measurement import Measurement
from manipose_mj.batch.starts import StartPool
from manipose_mj.errors import unknown_name
from manipose_mj.poses import Array, compose, invert, pose_to_vector
from manipose_mj.small_matrices import product
from manipose_mj.tasks.observations.sensors import parse_modes

Observation = dict[str, Array]
_ROBOT = "panda"
_OPENCV = np.array([1.0, -1.0, -1.0])  # from MuJoCo's camera axes to OpenCV's


class Observer:
    """The modes `state` and `pose`; of keys that were named one by one, those alone."""

    def __init__(self, pool: StartPool) -> None:
        """Raises InputError where an observation that is asked for does not exist."""
        layout = self._layout = pool.layout
        self._frames = stack_trees([start.frames for start in pool.starts])
        self._goals = stack_trees([start.goal_frames for start in pool.starts])
        self._constants = stack_trees([start.constants for start in pool.starts])
        self._parts = parse_modes(layout.obs_mode)
        first = stack_trees([pool.starts[0].measurement])
        known = jax.eval_shape(self._all, first, jnp.zeros(1, jnp.int32))
        for part in self._parts:
            if "/" in part and part not in known:
                raise unknown_name("observation key", part, known)
        self.names = tuple(name for name in known if self._shown(name))

    def observe(self, now: Measurement, rows: Int[Array, " worlds"]) -> Observation:
        """What the worlds show; rows: of the starts that they began with."""
        every = self._all(now, rows)
        return {name: every[name] for name in self.names}

    def _shown(self, name: str) -> bool:
        mode = "state" if name.startswith(f"{_ROBOT}/") else "pose"
        return mode in self._parts or name in self._parts

    def _all(self, now: Measurement, rows: Int[Array, " worlds"]) -> Observation:
        layout = self._layout
        tcp = compose(now.tcp_rotation, now.tcp_position)
        shown = {
            f"{_ROBOT}/joint_positions": now.joints,
            f"{_ROBOT}/joint_velocities": now.velocities,
            f"{_ROBOT}/joint_torques": now.torques,
            f"{_ROBOT}/gripper_opening": now.fingers.sum(-1, keepdims=True),
            f"{_ROBOT}/tcp_pose": _tcp_vector(tcp),
        }
        world = self._world_poses(now, rows)
        cameras = invert(compose(now.camera_rotations * _OPENCV, now.camera_positions))
        seen = product(cameras[:, None], world[:, :, None])
        for i, name in enumerate((*layout.frames, *layout.goal_frames)):
            shown[f"pose/{name}"] = world[:, i]
            # The robot's base is the world's origin.
            shown[f"pose/robot/{name}"] = world[:, i]
            if layout.cameras:
                shown[f"pose/cameras/{name}"] = seen[:, i]
        shown |= {name: values[rows] for name, values in self._constants.items()}
        if layout.shows_opening:
            shown["pose/opening"] = now.openings[:, :1]
        return shown

    def _world_poses(
        self, now: Measurement, rows: Int[Array, " worlds"]
    ) -> Float[Array, "worlds frames 4 4"]:
        """Of the frames, then the goals."""
        layout = self._layout
        first = len(layout.objects) + 2 * len(layout.parts)
        bodies = compose(now.rotations[:, first:], now.positions[:, first:])
        return jnp.concatenate([product(bodies, self._frames[rows]), self._goals[rows]], axis=1)


def _tcp_vector(tcp: Float[Array, "worlds 4 4"]) -> Float[Array, "worlds 7"]:
    """As `PandaRobot.tcp_vector`."""
    vector = pose_to_vector(tcp)
    sign = jnp.where(vector[:, 4:5] < 0, -1.0, 1.0)
    return jnp.concatenate([vector[:, :3], sign * vector[:, 3:]], axis=-1)
