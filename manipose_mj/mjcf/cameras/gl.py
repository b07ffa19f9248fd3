"""Which GL renderers work on this machine, found out without touching this process.

MuJoCo chooses its GL platform once per process, from MUJOCO_GL at `import mujoco`, and a failed
attempt can crash or leave PyOpenGL bound to the wrong platform: so each platform is tried in a
child process first, and only one that rendered a picture there is used here.
"""

from __future__ import annotations

import importlib
import logging
import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from typing import Any

from manipose_mj.errors import InputError, unknown_name

_log = logging.getLogger(__name__)

BACKENDS = ("egl", "osmesa", "glfw")  # in the order of preference
_PROBE_TIMEOUT_S = 60.0
_OFF = ("disable", "disabled", "off", "false", "0")
_REMEDIES = {
    "egl": "apt-get install libegl1 libopengl0, and a GPU driver (or libegl-mesa0 libgl1-mesa-dri)",
    "osmesa": "apt-get install libosmesa6",
    "glfw": "apt-get install libgl1 libglfw3, and an X or Wayland display",
}
_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><light pos='0 0 3'/><geom type='box' size='1 1 1' rgba='1 0 0 1'/>"
    "<camera name='c' pos='0 0 5'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 16, 16) as renderer:
    renderer.update_scene(data, 'c')
    pixel = renderer.render()[8, 8]
assert pixel[0] > 2 * max(pixel[1], 1), f'the picture is wrong: a red box came out as {pixel}'
print('rendered')
"""


@dataclass(frozen=True)
class GLStatus:
    """What a child process found out about one GL platform.

    Attributes:
      backend: `egl`, `osmesa` or `glfw`: a value for MUJOCO_GL.
      works: Whether it rendered a picture.
      reason: Why not; empty if it works.
      remedy: What to install; empty if it works.
    """

    backend: str
    works: bool
    reason: str = ""
    remedy: str = ""


@cache
def probe(backend: str) -> GLStatus:
    """Try one platform in a child process; the answer is kept for this process' life.

    Raises:
      InputError: Not one of `BACKENDS`.
    """
    if backend not in BACKENDS:
        raise unknown_name("GL backend", backend, BACKENDS)
    environment = {k: v for k, v in os.environ.items() if k != "PYOPENGL_PLATFORM"}
    environment["MUJOCO_GL"] = backend
    if backend == "glfw" and sys.platform == "linux" and not _has_display():
        # GLFW prints, and takes a second, to say the same.
        return _failed(backend, "neither DISPLAY nor WAYLAND_DISPLAY is set")
    try:
        child = subprocess.run(
            [sys.executable, "-c", _PROBE],
            env=environment,
            capture_output=True,
            text=True,
            timeout=_PROBE_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return _failed(backend, f"no picture within {_PROBE_TIMEOUT_S:.0f} s")
    if child.returncode == 0 and "rendered" in child.stdout:
        return GLStatus(backend, works=True)
    if child.returncode < 0:
        return _failed(backend, f"crashed with signal {-child.returncode}")
    lines = [line.strip() for line in child.stderr.splitlines()]
    # The error's own line starts at the margin; destructors complain after it.
    errors = [
        line for line in lines if "Error" in line.split(":")[0] and " " not in line.split(":")[0]
    ]
    return _failed(backend, (errors or lines or ["no message"])[0])


def probe_all() -> tuple[GLStatus, ...]:
    """The status of every platform, in the order of preference."""
    return tuple(probe(backend) for backend in BACKENDS)


def working_backend() -> str | None:
    """The platform to render with, or None.

    MUJOCO_GL decides where it names a platform or switches GL off; else the first that works.
    """
    requested = os.environ.get("MUJOCO_GL", "").lower().strip()
    if requested in _OFF:
        return None
    candidates = (requested,) if requested in BACKENDS else BACKENDS
    return next((b for b in candidates if probe(b).works), None)


def why_not() -> str:
    """One line that says why there is no GL here and what to install."""
    if os.environ.get("MUJOCO_GL", "").lower().strip() in _OFF:
        return "GL is switched off by MUJOCO_GL; unset it to use GL"
    return f"no GL renderer works here; for one without a GPU: {_REMEDIES['osmesa']}"


def activate() -> str:
    """Bind this process' `mujoco.Renderer` to the working platform and return its name.

    Raises:
      InputError: No platform works, or this process has bound PyOpenGL to another one already.
    """
    backend = working_backend()
    if backend is None:
        raise InputError(why_not())
    bound = os.environ.get("PYOPENGL_PLATFORM", "").lower()
    if "OpenGL" in sys.modules and backend != "glfw" and bound not in ("", backend):
        raise InputError(
            f"this process uses PyOpenGL for {bound!r} already; start it with MUJOCO_GL={backend}"
        )
    os.environ["MUJOCO_GL"] = backend
    if backend != "glfw" and "OpenGL" not in sys.modules:
        os.environ["PYOPENGL_PLATFORM"] = backend
    # `import mujoco` chose a platform before we could; the renderer looks the class up when made.
    chooser: Any = importlib.import_module("mujoco.rendering.classic.gl_context")
    platform = importlib.import_module(f"mujoco.{backend}")
    if getattr(chooser, "GLContext", None) is not platform.GLContext:
        _log.info("rendering with %s", backend)
        chooser.GLContext = platform.GLContext
    return backend


def _has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _failed(backend: str, reason: str) -> GLStatus:
    return GLStatus(backend, works=False, reason=reason, remedy=_REMEDIES[backend])
