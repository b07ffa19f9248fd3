"""Renders all worlds of the engine `warp` with MuJoCo Warp's ray tracer, one captured graph a look."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import mujoco
import mujoco_warp  # pyright: ignore[reportMissingImports]
import numpy as np
import warp as wp  # pyright: ignore[reportMissingImports]
from jaxtyping import Int, UInt8, UInt32

from manipose_mj.mjcf.cameras.ray_casting import VISIBLE_GROUPS
from manipose_mj.poses import Array

Rendered = tuple[Array, Array, Array | None]


class WarpRenderer:
    """Depth, geoms and, if asked for, colours of some cameras."""

    def __init__(
        self,
        host: mujoco.MjModel,
        model: Any,
        data: Any,
        take_starts: Callable[[Any], None],
        cameras: tuple[str, ...],
        size: tuple[int, int],
        rgb: bool,
    ) -> None:
        """Compiles the renderer for these geoms and cameras.

        Args:
          host: MuJoCo's own model.
          model: MuJoCo Warp's, with fields by world.
          data: Of all worlds, used as scratch.
          take_starts: Gives the model the fields of the worlds' starts.
          cameras: Their names.
          size: Height and width of the images [pixels].
          rgb: Whether to render colours.
        """
        self._model, self._data, self._take_starts = model, data, take_starts
        self._rgb, self._device = rgb, data.qpos.device
        worlds, pixels = data.nworld, len(cameras) * size[0] * size[1]
        with wp.ScopedDevice(self._device):
            self._context = mujoco_warp.create_render_context(
                host,
                nworld=worlds,
                cam_res=(size[1], size[0]),
                render_rgb=rgb,
                render_depth=True,
                render_seg=True,
                cam_active=list(cameras),
                enabled_geom_groups=list(VISIBLE_GROUPS),
                # The fields of view may differ between worlds.
                use_precomputed_rays=model.cam_fovy.shape[0] == 1,
            )
            self._draw()  # no kernel can be compiled while a graph is captured
            wp.synchronize_device()

        def look(
            rows: wp.array[int],
            qpos: wp.array2d[float],
            depth: wp.array2d[float],
            seen: wp.array2d[wp.vec2i],
            colours: wp.array2d[wp.uint32],
        ):
            self._take_starts(rows)
            wp.copy(data.qpos, qpos)
            self._draw()
            wp.copy(depth, self._context.depth_data)
            wp.copy(seen, self._context.seg_data)
            if rgb:
                wp.copy(colours, self._context.rgb_data)

        graphs = wp.JaxCallableGraphMode
        self._call = wp.jax_callable(
            look,
            num_outputs=3,
            output_dims={
                "depth": (worlds, pixels),
                "seen": (worlds, pixels),
                "colours": (worlds, pixels if rgb else 1),
            },
            graph_mode=graphs.WARP_STAGED if self._device.is_cuda else graphs.NONE,
        )

    def _draw(self) -> None:
        model, data = self._model, self._data
        mujoco_warp.kinematics(model, data)
        mujoco_warp.com_pos(model, data)
        mujoco_warp.camlight(model, data)
        mujoco_warp.refit_bvh(model, data, self._context)
        mujoco_warp.render(model, data, self._context)

    def __call__(self, physics: dict[str, Array], rows: Int[Array, " worlds"]) -> Rendered:
        """Depth, ids of geoms (-1: nothing) and colours, `(worlds, cameras * height * width, ...)`."""
        depth, seen, colours = self._call(rows, physics["qpos"])
        return depth, seen[..., 0], _unpacked(colours) if self._rgb else None


def _unpacked(colours: UInt32[Array, "worlds pixels"]) -> UInt8[Array, "worlds pixels 3"]:
    """Bytes of red, green and blue."""
    shifts = np.array([16, 8, 0], np.uint32)
    return ((colours[..., None] >> shifts) & np.uint32(255)).astype(jnp.uint8)
