"""Colour pictures of a scene, by GL where it works and by ray casting where it does not."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal, Protocol

import mujoco
import numpy as np
from jaxtyping import UInt8

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.mjcf.cameras import gl
from manipose_mj.mjcf.cameras.ray_camera import camera_id
from manipose_mj.mjcf.cameras.ray_casting import PICTURE_GROUPS
from manipose_mj.mjcf.cameras.ray_picture import RayPainter, RayShading

_log = logging.getLogger(__name__)

Engine = Literal["auto", "gl", "ray"]
ENGINES: tuple[str, ...] = ("auto", "gl", "ray")
MOST_PIXELS = 2**26  # a square of 8192: rays take gigabytes beyond


class Painter(Protocol):
    """Turns states of one model into pictures of one size."""

    def paint(self, data: mujoco.MjData, camera: int | str) -> UInt8[np.ndarray, "height width 3"]:
        """What the camera sees."""
        ...

    def close(self) -> None:
        """Free what GL holds."""
        ...


def render(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    camera: int | str,
    height: int = 480,
    width: int = 640,
    *,
    engine: Engine = "auto",
) -> UInt8[np.ndarray, "height width 3"]:
    """One picture; for more of the same model, `painter` saves the set-up.

    Args:
      model: The compiled model.
      data: Its state after `mj_forward`.
      camera: Name or id.
      height: In pixels.
      width: In pixels.
      engine: "gl" for MuJoCo's renderer, "ray" for ours, "auto" for GL if it works here.

    Raises:
      InputError: No such camera or engine, a size that cannot be drawn, or GL was asked for and does not work.
    """
    with painter(model, height, width, engine=engine) as paint:
        return paint.paint(data, camera)


@contextmanager
def painter(
    model: mujoco.MjModel, height: int, width: int, *, engine: Engine = "auto"
) -> Iterator[Painter]:
    """A painter for many pictures of a model; arguments and errors as for `render`."""
    drawing = make_painter(model, height, width, engine=engine)
    try:
        yield drawing
    finally:
        drawing.close()


def make_painter(
    model: mujoco.MjModel,
    height: int,
    width: int,
    *,
    engine: Engine = "auto",
    groups: tuple[int, ...] = PICTURE_GROUPS,
    shading: RayShading | None = None,
) -> Painter:
    """A painter that the caller closes; arguments and errors as for `render`.

    Args:
      model: The compiled model.
      height: In pixels.
      width: In pixels.
      engine: Which renderer.
      groups: Of the geoms that are shown.
      shading: Of pictures without GL.
    """
    if engine not in ENGINES:
        raise unknown_name("engine", engine, ENGINES)
    if height < 1 or width < 1:
        raise InputError(f"picture size {height} x {width}: height and width must be positive")
    if height * width > MOST_PIXELS:
        raise InputError(
            f"picture size {height} x {width}: expected at most {MOST_PIXELS} pixels, as of 8192 x 8192"
        )
    try:
        if binds_gl(engine):
            return _GLPainter(model, height, width, groups)
        return RayPainter(model, height, width, shading, groups=groups)
    except (mujoco.FatalError, MemoryError) as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"picture size {height} x {width}: cannot be drawn here ({reason}); choose a smaller one"
        ) from None


def binds_gl(engine: Engine) -> bool:
    """Whether this engine is GL here; binds this process to the platform that works.

    Raises:
      InputError: GL was asked for and does not work; says what to install.
    """
    if engine == "ray":
        return False
    if engine == "gl":
        gl.activate()
        return True
    if gl.working_backend() is None:
        return False
    try:
        gl.activate()
    except InputError as error:
        _log.warning("drawing without GL: %s", error)
        return False
    return True


class _GLPainter:
    """`mujoco.Renderer` at any size, showing what our pictures show."""

    def __init__(
        self, model: mujoco.MjModel, height: int, width: int, groups: tuple[int, ...]
    ) -> None:
        self._model = model
        limits = model.vis.global_
        # The off-screen buffer is a limit of the model, not of GL.
        limits.offwidth = max(limits.offwidth, width)
        limits.offheight = max(limits.offheight, height)
        self._renderer: Any = mujoco.Renderer(model, height, width)
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[list(groups)] = 1

    def paint(self, data: mujoco.MjData, camera: int | str) -> UInt8[np.ndarray, "height width 3"]:
        """What the camera sees."""
        self._renderer.update_scene(data, camera_id(self._model, camera), self._option)
        return self._renderer.render()

    def close(self) -> None:
        """Free the GL context."""
        self._renderer.close()
