"""A drawer whose joint is estimated 20 deg off comes open, for the hand follows it."""

from __future__ import annotations

import pytest

from benchmarks.experiments.joint_errors import Stiff, opened
from manipose_mj import suite
from manipose_mj.control.perception.pose_sources import sensors_for
from manipose_mj.control.perception.sensed_world import SensedWorld
from manipose_mj.tasks.core.config import EnvConfig


@pytest.mark.full
def test_a_drawer_opens_though_its_joint_is_20_deg_off(optimised):
    config = EnvConfig(
        "articulated/open_middle_drawer",
        obs_mode="state",
        objects=("cabinet_000", "cabinet_003"),
        sensors=sensors_for("estimated"),
    )
    environment = suite.make(config, 0)
    assert opened(environment, 0, 20.0, SensedWorld)
    assert not opened(environment, 0, 20.0, Stiff)
