"""Intervals and aggregates."""

from __future__ import annotations

import pytest

from manipose_mj.evaluation.records import EpisodeResult
from manipose_mj.evaluation.statistics import summarize, versions, wilson_interval
from manipose_mj.storage import source_hash


def result(task: str, episode: int, failure: str | None, **changes) -> EpisodeResult:
    values = {
        "task": task,
        "episode": episode,
        "seed": episode,
        "object": "mug",
        "pose_source": "oracle",
        "success_once": failure is None,
        "success_at_end": failure is None,
        "failure": failure,
        "reason": "",
        "translation_error": 0.01 * (episode + 1),
        "rotation_error": None,
        "steps": 10,
        "sim_time": 1.0,
        "max_penetration": 0.001 * episode,
        "wall_s": float(episode),
    }
    return EpisodeResult(**values | changes)


@pytest.mark.parametrize(
    ("successes", "trials", "interval"),
    # Newcombe, Two-sided confidence intervals for the single proportion (1998), table I.
    [(81, 263, (0.2553, 0.3662)), (15, 148, (0.0624, 0.1605)), (0, 20, (0.0, 0.1611))],
)
def test_wilson_interval_as_published(successes, trials, interval) -> None:
    assert wilson_interval(successes, trials) == pytest.approx(interval, abs=5e-5)


def test_summary_counts_per_task() -> None:
    results = [result("b/x", 1, "timeout", success_once=True), result("b/x", 0, None)]
    results += [result("a/y", e, "grasp" if e else None, translation_error=None) for e in range(3)]
    summary = summarize(results)
    assert list(summary) == ["a/y", "b/x"]
    assert summary["b/x"]["episodes"] == 2
    assert summary["b/x"]["success_at_end"] == 1
    assert summary["b/x"]["success_once"] == 2
    assert summary["b/x"]["failures"] == {"timeout": 1}
    assert summary["b/x"]["median_wall_s"] == 0.5
    assert summary["b/x"]["median_translation_error_m"] == pytest.approx(0.015)
    assert summary["b/x"]["wilson_95"] == pytest.approx(wilson_interval(1, 2))
    assert summary["a/y"]["failures"] == {"grasp": 2}
    assert summary["a/y"]["median_translation_error_m"] is None
    assert summary["a/y"]["max_penetration_m"] == pytest.approx(0.002)


def test_a_result_cannot_contradict_itself() -> None:
    with pytest.raises(ValueError, match="exactly when"):
        result("a/y", 0, None, success_at_end=False)
    with pytest.raises(ValueError, match="expected one of perception"):
        result("a/y", 0, "bored")


def test_versions_name_what_can_change_a_result() -> None:
    named = {"python", "mujoco", "dm_control", "mink", "jax", "numpy", "trimesh", "platform"}
    assert named <= versions().keys() and "not installed" not in versions().values()


def test_the_source_has_a_hash_of_all_that_ships(tmp_path, monkeypatch):
    monkeypatch.setattr(source_hash, "_ROOT", tmp_path)
    for name in ("manipose_mj/a.py", "asset_pipeline/b.json", "manipose_mj/weights/c.npz"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("1")
    whole = source_hash.distribution_hash.__wrapped__
    hashes = [whole()]
    for path in sorted(tmp_path.rglob("*.*")):
        path.write_text("2")
        hashes.append(whole())
    (tmp_path / "manipose_mj" / "__pycache__.pyc").write_text("3")
    assert len(set(hashes)) == 4 and whole() == hashes[-1]
    assert len(versions()["source"]) == 12
