"""Folders that tests read from."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).parents[1]
# What the data sets' publishers ship; tests of it are skipped where it is not.
REAL_DATA = Path(os.environ.get("MANIPOSE_REAL_DATA", ROOT.parent / "shared" / "data"))
