"""ManiPose-MJ: pose-aware manipulation on MuJoCo."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from manipose_mj.suite import register_suite
    from manipose_mj.tasks.core.config import EnvConfig
    from manipose_mj.tasks.core.registry import register_task

__version__ = "0.1.0"
__all__ = ["EnvConfig", "__version__", "register_suite", "register_task"]

__getattr__ = lazy_exports(__name__, __file__)

# dm_control looks for a display as it is imported, and GLFW warns where there is none: nothing is lost by that.
warnings.filterwarnings("ignore", message=r"\(\d+\) b'(X11|Wayland): ", module="glfw")
