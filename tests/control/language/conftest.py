"""Local endpoints of language models."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from manipose_mj.control.language.endpoint import KEY_VARIABLE
from tests.control.language.local_server import KEY, Server


@pytest.fixture
def serve(monkeypatch) -> Iterator:
    """Starts servers that answer with one behaviour after the other; the key is `KEY`."""
    monkeypatch.setenv(KEY_VARIABLE, KEY)
    servers = []

    def start(*behaviours) -> Server:
        servers.append(Server(list(behaviours)))
        return servers[-1]

    yield start
    for server in servers:
        server.close()
