"""The comparison of verdicts counts a plan as alike where both engines say the same of it."""

from __future__ import annotations

import importlib

import numpy as np
import pytest

from manipose_mj.robustness.plans import Plans, RecordedPlan
from manipose_mj.robustness.replay import Replay
from manipose_mj.tasks.core.config import EnvConfig

TASK = "single_object/target_pose"


@pytest.fixture
def parity():
    return importlib.import_module("verdict_parity")


def replay(plan: int, success: bool, valid: bool = True) -> Replay:
    return Replay(plan, {}, success, success, valid)


def test_the_share_alike_has_its_interval(parity):
    same = [(TASK, replay(i, True), replay(i, True)) for i in range(9)]
    row = parity.row("some", [*same, (TASK, replay(9, True), replay(9, False, valid=False))])
    assert row == "| some | 10 | 10 | 9 | 90.0% | 59.6% to 98.2% |"


def test_replays_of_different_plans_are_not_compared(parity):
    with pytest.raises(AssertionError, match="different plans"):
        parity.row("some", [(TASK, replay(1, True), replay(2, True))])


def test_every_plan_is_played_once_in_its_own_world(parity, monkeypatch, capsys):
    config = EnvConfig(TASK, obs_mode="state", objects=("box_000",))
    plan = RecordedPlan(3, np.tile([0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.8, 0.08], (3, 1)))
    monkeypatch.setattr(parity, "recorded_plans", lambda *a, **b: Plans(config, (plan,)))
    monkeypatch.setattr("sys.argv", ["verdict_parity", TASK, "--engines", "c", "c"])
    parity.main()
    assert f"| {TASK} | 1 | 0 | 0 | 100.0% |" in capsys.readouterr().out
