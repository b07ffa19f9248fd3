"""The robot alone, for the tests of control modes."""

from __future__ import annotations

import pytest

from tests.actions.driven_arm import Arm


@pytest.fixture(scope="module")
def arm() -> Arm:
    """Compiled once; tests start it in the mode that they are about."""
    return Arm()
