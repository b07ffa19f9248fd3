"""What `render` shows: pictures by GL or rays, or a window."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np
from dm_control import mjcf
from jaxtyping import UInt8

from manipose_mj.errors import check_count
from manipose_mj.mjcf.cameras.pictures import painter
from manipose_mj.mjcf.cameras.ray_camera import camera_id
from manipose_mj.mjcf.views.viewer import open_viewer, require_display


class View:
    """Pictures or a window of one environment, made when they are first asked for."""

    def __init__(self, render_mode: str | None, camera: str, height: int, width: int) -> None:
        """Opens nothing yet.

        Raises:
          InputError: A window is asked for and there is no display, or a size is none.
        """
        check_count("height of pictures", height, least=1)
        check_count("width of pictures", width, least=1)
        if render_mode == "human":
            require_display()
        self._mode = render_mode
        self._camera = camera
        self._size = (height, width)
        self._model: Any = None
        self._shown: Any = None
        self._stack = ExitStack()

    def check(self, physics: mjcf.Physics) -> None:
        """Raises InputError where pictures are asked for and the scene has no such camera."""
        if self._mode == "rgb_array":
            camera_id(physics.model.ptr, self._camera)

    def render(self, physics: mjcf.Physics) -> UInt8[np.ndarray, "height width 3"] | None:
        """The picture, or None where a window shows it."""
        if self._mode is None:
            return None
        model, data = physics.model.ptr, physics.data.ptr
        if self._model is not model:
            # The first reset compiles the model anew.
            self.close()
            opened = open_viewer(model, data) if self._mode == "human" else self._painter(model)
            self._shown = self._stack.enter_context(opened)
            self._model = model
        if self._mode == "human":
            self._shown.sync()
            return None
        return self._shown.paint(data, self._camera)

    def _painter(self, model: Any) -> Any:
        return painter(model, *self._size, engine="auto")

    def close(self) -> None:
        """Free the GL context or shut the window."""
        self._model = None
        self._stack.close()
