"""What the cameras of batched worlds see: depth, segmentation and pictures of every world at once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int, UInt8

from manipose_mj.batch.starts import RowModels
from manipose_mj.batch.state import State, check_state
from manipose_mj.batch.worlds import Worlds
from manipose_mj.errors import InputError, check_count, unknown_name
from manipose_mj.mjcf.cameras.ray_camera import camera_intrinsics
from manipose_mj.poses import Array, compose
from manipose_mj.tasks.scene.indices import FIRST

_OPENCV = np.array([1.0, -1.0, -1.0])  # from MuJoCo's camera axes to OpenCV's


class Images(NamedTuple):
    """What the cameras of all worlds see.

    Attributes:
      depth: Along the optical axis [m]; 0 where nothing is.
      instance: As the CPU task's segmentation numbers them; 0: nothing of its own.
      rgb: Colours, if they were asked for.
      poses: `T_world_camera`, OpenCV's axes.
      pinholes: `fx, fy, cx, cy` [pixels].
    """

    depth: Float[Array, "worlds cameras height width"]
    instance: Int[Array, "worlds cameras height width"]
    rgb: UInt8[Array, "worlds cameras height width 3"] | None
    poses: Float[Array, "worlds cameras 4 4"]
    pinholes: Float[Array, "worlds cameras 4"]


class Cameras:
    """Cameras of batched worlds.

    Attributes:
      names: Of the cameras.
    """

    def __init__(
        self,
        worlds: Worlds,
        names: tuple[str, ...] | None = None,
        *,
        height: int = 120,
        width: int = 160,
        rgb: bool = False,
    ) -> None:
        """Prepares; on a GPU it compiles the renderer.

        Args:
          worlds: Whose cameras they are; on the engine `warp`, worlds of several objects have to be made with
            `visual=True`.
          names: Of those that the worlds' `sensors` name; None: all of them.
          height, width: Of the images [pixels].
          rgb: Whether to render colours too; the engine `c` has none.

        Raises:
          InputError: There is no such camera, a size is none, or the engine cannot render it.
        """
        pool = worlds.pool
        known = pool.layout.cameras
        if names is not None and (isinstance(names, str) or not isinstance(names, Iterable)):
            raise InputError(f"names is {names!r}; expected a tuple of cameras' names")
        self.names = known if names is None else tuple(names)
        for name in self.names:
            if name not in known:
                raise unknown_name("camera of these worlds", name, known)
        if not known:
            raise InputError("these worlds have no cameras; make them with sensors that name some")
        if not self.names:
            raise InputError(
                f"names is empty; expected some of {', '.join(known)}, or None for all"
            )
        check_count("height", height, least=1)
        check_count("width", width, least=1)
        self._whose = worlds.identity, worlds.count
        self._shape = (worlds.count, len(self.names), height, width)
        self._chosen = np.array([known.index(name) for name in self.names])
        self._render = worlds.engine.renderer(self.names, height, width, rgb)
        models = RowModels(pool)
        pinholes, far, instances, numbers = [], [], [], []
        for row, start in enumerate(pool.starts):
            model = models.at(row)
            each = [camera_intrinsics(model, name, height, width) for name in self.names]
            pinholes.append([(i.fx, i.fy, i.cx, i.cy) for i in each])
            far.append(float(model.vis.map.zfar * model.stat.extent))
            geoms = worlds.engine.scene_geoms(row)
            instances.append(np.where(geoms < 0, 0, start.instances[geoms]))
            owners = [start.addresses.owners == FIRST + i for i in range(len(pool.layout.objects))]
            numbers.append([int(start.instances[own].max(initial=0)) for own in owners])
        self._pinholes = jnp.asarray(pinholes, jnp.float32)
        self._far = jnp.asarray(far, jnp.float32)
        # Nothing, -1, finds the last one, which is none.
        most = max(map(len, instances)) + 1
        padded = [np.pad(each, (0, most - len(each))) for each in instances]
        self._instances = jnp.asarray(np.stack(padded), jnp.int32)
        self._numbers = jnp.asarray(numbers, jnp.int32).reshape(len(pool.starts), -1)
        self.look = jax.jit(self._look)

    def numbers(self, state: State) -> Int[Array, "worlds objects"]:
        """The instances of the layout's objects in each world; 0 for those that it does not have."""
        return self._numbers[state.row]

    def _look(self, state: State) -> Images:
        """What they see now; a pure function of the state, jitted as `look`."""
        check_state(state, *self._whose)
        rows = state.row
        depth, geoms, rgb = self._render(state.simulation, rows)
        depth, geoms = depth.reshape(self._shape), geoms.reshape(self._shape)
        seen = (geoms >= 0) & (depth <= self._far[rows][:, None, None, None])
        world = jnp.arange(len(rows))[:, None, None, None]
        instance = self._instances[rows][world, jnp.where(seen, geoms, -1)]
        now = state.measurement
        positions = now.camera_positions[:, self._chosen]
        rotations = now.camera_rotations[:, self._chosen] * _OPENCV
        return Images(
            jnp.where(seen, depth, 0.0),
            instance,
            None if rgb is None else rgb.reshape(*self._shape, 3),
            compose(rotations, positions),
            self._pinholes[rows],
        )
