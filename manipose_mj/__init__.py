"""ManiPose-MJ: pose-aware manipulation on MuJoCo."""

from __future__ import annotations

__version__ = "0.1.0"


def register_suite() -> None:
    """Make `dm_control.suite.load(domain, task)` know this package's tasks."""
    from manipose_mj.suite import register_suite as register

    register()


__all__ = ["__version__", "register_suite"]
