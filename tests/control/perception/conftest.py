"""A cup that cameras see."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj import suite
from tests.control.perception.recalled import CUP, config_of


@pytest.fixture(scope="module")
def cup():
    """An environment with a cup that a camera sees."""
    environment = suite.make(config_of(CUP))
    environment.reset()
    return environment


@pytest.fixture
def truth(cup):
    """The environment at the start of an episode, and the label's pose and lengths there."""
    cup.random_state.seed(1)
    cup.reset()
    obj = cup.task.object
    return obj.label_pose(cup.physics), np.array(obj.asset.label.extents)
