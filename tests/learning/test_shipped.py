"""The policy that ships: small, and as good on the protocol as its page says."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest

from manipose_mj.evaluation.config import BatchSettings, EvaluationConfig
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.learning import TrainedPolicy

WEIGHTS = Path(str(resources.files("manipose_mj.learning"))) / "weights"
TASK = "articulated/open_middle_drawer"


def test_it_is_small_and_says_what_it_is():
    files = list(WEIGHTS.glob("*.npz"))
    assert [file.stem for file in files] == ["open_middle_drawer"]
    assert sum(file.stat().st_size for file in files) < 2e6
    metadata = TrainedPolicy().metadata
    assert (metadata["trained on"], metadata["seed"]) == (TASK, 0)


@pytest.mark.full
def test_it_opens_drawers_of_cabinets_that_it_was_not_trained_on(tmp_path):
    """In single environments 97 of 100; of the first 24 these are all but one."""
    settings = PolicySettings(
        "manipose_mj.learning:TrainedPolicy",
        obs_mode="state+pose",
        control_mode="pd_ee_pose",
        hz=5.0,
    )
    batch = BatchSettings("c", 24)
    config = EvaluationConfig(
        (TASK,), tmp_path, episodes=24, protocol="v1", policy=settings, batch=batch
    )
    results = evaluate(config)
    assert {result.object for result in results} == {f"cabinet_{i:03}" for i in (4, 14, 19, 24)}
    assert sum(result.success_at_end for result in results) >= 21
