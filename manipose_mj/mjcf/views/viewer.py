"""MuJoCo's window, where there is a display."""

from __future__ import annotations

import os
import sys
import warnings
from typing import Any

import mujoco

from manipose_mj.errors import InputError


def require_display() -> None:
    """Say in one line why no window can open here.

    Raises:
      InputError: There is no display.
    """
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise InputError(
            "a window needs a display, and neither DISPLAY nor WAYLAND_DISPLAY is set; pictures need "
            'none: `manipose render`, or render_mode="rgb_array"'
        )


def open_viewer(model: mujoco.MjModel, data: mujoco.MjData) -> Any:
    """An open window, as a context manager with `sync()` and `is_running()`.

    Raises:
      InputError: No window can open here.
    """
    require_display()
    import glfw
    import mujoco.viewer

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        works = glfw.init()  # in the viewer's own thread a failure would go unheard
    if not works:
        display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        raise InputError(
            f"no window can be opened on display {display}; pictures need none: render"
        )
    try:
        return mujoco.viewer.launch_passive(model, data)
    except RuntimeError as error:  # macOS: not under mjpython
        raise InputError(f"no window can be opened: {' '.join(str(error).split())}") from None
