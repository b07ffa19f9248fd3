"""Tasks that several files here run over."""

from __future__ import annotations

import pytest
from dm_control import composer

from manipose_mj import suite
from tests.few_objects import load


@pytest.fixture(scope="module", params=suite.ALL_TASKS, ids="/".join)
def blind(request) -> composer.Environment:
    """One environment a task, without sensors, for long runs."""
    return load(*request.param, seed=0, obs_mode="state")


@pytest.fixture(
    scope="module",
    params=["single_object/target_pose", "articulated/store_chips_can_middle_drawer"],
)
def ideal(request) -> composer.Environment:
    """A task with every observation, none of them noisy."""
    from tests.tasks.observed_scenes import EVERYTHING, load

    return load(tuple(request.param.split("/")), EVERYTHING)
