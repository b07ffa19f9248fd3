"""Lets these tests import the tasks that lie beside them, also in processes that they spawn."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
