"""Whether built assets load alone, look as they touch, come to rest, open, and hold what is put into them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from asset_pipeline.checks.asset_check import CheckLimits, CheckResult, check
    from asset_pipeline.checks.cavity_check import takes_ball

__all__ = ["CheckLimits", "CheckResult", "check", "takes_ball"]

__getattr__ = lazy_exports(__name__, __file__)
