"""Let the tests of this folder import `episode_driver`, and give them every task without sensors."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from dm_control import composer

from manipose_mj import suite

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="module", params=suite.ALL_TASKS, ids="/".join)
def blind(request) -> composer.Environment:
    """One environment a task, without sensors, for long runs."""
    return suite.load(*request.param, seed=0, observations="state")
