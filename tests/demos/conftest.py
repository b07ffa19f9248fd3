"""Two demonstrations, recorded once."""

from __future__ import annotations

import shutil

import pytest

from manipose_mj.demos.record import record
from tests.demos.recordings import config


@pytest.fixture(scope="session")
def demos(tmp_path_factory):
    return record(config(tmp_path_factory.mktemp("demos")))


@pytest.fixture
def copied(demos, tmp_path):
    """The recordings in a folder that a test may damage."""
    shutil.copytree(demos.path.parent, tmp_path / "copied")
    return tmp_path / "copied" / demos.path.name
