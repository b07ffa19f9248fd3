"""The policies that ship: small, and as good on the protocol as their page says."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib import resources
from pathlib import Path

import pytest

from manipose_mj.evaluation.config import BatchSettings, EvaluationConfig
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.learning import TrainedPolicy

ROOT = Path(__file__).parents[2]
WEIGHTS = Path(str(resources.files("manipose_mj.learning"))) / "weights"
SHIPPED = {
    "lift": "example/lift",
    "open_cabinet_door": "articulated/open_cabinet_door",
    "open_middle_drawer": "articulated/open_middle_drawer",
}
LIFTED = ("apple", "bottle", "box", "can", "candle", "chips_can", "drinkbox", "pear")


def test_they_are_small_and_say_what_they_are():
    files = sorted(WEIGHTS.glob("*.npz"))
    assert [file.stem for file in files] == list(SHIPPED)
    assert sum(file.stat().st_size for file in files) < 2e6
    for name, task in SHIPPED.items():
        metadata = TrainedPolicy(name).metadata
        assert (metadata["trained on"], metadata["seed"]) == (task, 0)


@pytest.mark.full
@pytest.mark.parametrize(
    ("name", "pieces", "least"),
    [
        ("open_middle_drawer", (4, 14, 19, 24), 22),  # in single environments 97 %
        ("open_cabinet_door", (4, 9, 14, 34, 39), 22),  # 94 %
    ],
)
def test_they_open_parts_of_cabinets_that_they_were_not_trained_on(tmp_path, name, pieces, least):
    """So many episodes of the protocol that rounding on another processor does not decide."""
    settings = PolicySettings(
        "manipose_mj.learning:TrainedPolicy",
        json.dumps({"path": name}),
        obs_mode="state+pose",
        control_mode="pd_ee_pose",
        hz=5.0,
    )
    batch = BatchSettings("c", 25)
    config = EvaluationConfig(
        (f"articulated/{name}",), tmp_path, episodes=25, protocol="v1", policy=settings, batch=batch
    )
    results = evaluate(config)
    assert len(results) == 25
    assert {result.object for result in results} == {f"cabinet_{i:03}" for i in pieces}
    assert sum(result.success_at_end for result in results) >= least


@pytest.mark.full
def test_it_lifts_objects_that_it_was_not_trained_on(tmp_path, monkeypatch):
    """In a process of its own, as the task is one of `benchmarks`."""
    monkeypatch.setenv("MANIPOSE_TASKS", "lift_task")
    objects = [f"{category}_{i:03}" for category in LIFTED for i in (4, 9, 14)]
    command = (
        *(sys.executable, "-m", "manipose_mj.cli.main", "evaluate", "example/lift"),
        *("--policy", "manipose_mj.learning:TrainedPolicy", "--policy-args", '{"path": "lift"}'),
        *("--obs-mode", "state+pose", "--control-mode", "pd_ee_pose", "--hz", "5"),
        *("--episodes", "48", "--seed", "100", "--engine", "c", "--worlds", "48"),
        *("--out", str(tmp_path), "--objects", *objects),
    )
    done = subprocess.run(
        command, cwd=ROOT / "benchmarks" / "batch", capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    results = [json.loads(line) for line in (tmp_path / "results.jsonl").read_text().splitlines()]
    assert len(results) == 48
    # In single environments 90 %.
    assert sum(result["success_at_end"] for result in results) >= 38
