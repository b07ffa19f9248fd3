"""Where everything that is computed once and kept lies on this machine."""

from __future__ import annotations

import os
from pathlib import Path

CACHE_VARIABLE = "MANIPOSE_CACHE"


def cache_root() -> Path:
    """`$MANIPOSE_CACHE`, or `~/.cache/manipose-mj`."""
    configured = os.environ.get(CACHE_VARIABLE)
    return Path(configured) if configured else Path.home() / ".cache" / "manipose-mj"
