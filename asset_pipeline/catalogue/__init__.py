"""Objects of the built-in catalogue: generated and built, one or many, or drafted for pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from asset_pipeline.catalogue.parallel_build import build_catalogue

__all__ = ["build_catalogue"]

__getattr__ = lazy_exports(__name__, __file__)
