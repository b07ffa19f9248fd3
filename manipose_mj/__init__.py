"""ManiPose-MJ: pose-aware manipulation on MuJoCo."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from manipose_mj.tasks.registry import register_task as register_task

__version__ = "0.1.0"


def register_suite() -> None:
    """Make `dm_control.suite.load(domain, task)` know this package's tasks."""
    from manipose_mj.suite import register_suite as register

    register()


def __getattr__(name: str) -> Any:
    if name == "register_task":  # loads the simulator, which `import manipose_mj` does not
        from manipose_mj.tasks.registry import register_task

        return register_task
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = ["__version__", "register_suite", "register_task"]
