"""A server of scans for the tests of this folder."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.asset_pipeline.fetching.scan_site import Site, served


@pytest.fixture
def server() -> Iterator[Site]:
    """A site of scans, served while the test runs."""
    with served() as site:
        yield site
