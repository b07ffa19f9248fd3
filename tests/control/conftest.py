"""Let the tests of this folder import `driven_arm`, and give them one."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="module")
def arm():
    """The robot alone, compiled once; tests start it in the mode that they are about."""
    from driven_arm import Arm

    return Arm()
