"""Let the tests of this folder import their helper modules, and give them a server of scans."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def server():
    """A `scan_site.Site`, served while the test runs."""
    from scan_site import served

    with served() as site:
        yield site
