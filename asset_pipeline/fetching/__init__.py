"""Downloads of data sets that can be interrupted and verified, and how to get those that need an account."""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from asset_pipeline.fetching.publishers import PUBLISHERS, Publisher
    from asset_pipeline.fetching.scan_files import FetchResult, fetch

__all__ = ["PUBLISHERS", "FetchResult", "Publisher", "fetch"]

__getattr__ = lazy_exports(__name__, __file__)
