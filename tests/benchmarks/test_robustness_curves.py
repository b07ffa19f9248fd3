"""The sweep over errors plays the same episodes at every size, and goes on where it was interrupted."""

from __future__ import annotations

import csv
import importlib

import pytest

import tests.evaluation.fake_episodes as fake
from manipose_mj.errors import InputError
from manipose_mj.evaluation.injected_errors import InjectedErrors


@pytest.fixture
def curves(monkeypatch):
    module = importlib.import_module("robustness_curves")
    real = module.evaluate
    played = []

    def evaluate(config, resume):
        before = (config.out / "results.jsonl").exists()
        results = real(config, resume=resume, runner=fake.make_runner())
        if not before:
            played.append((config, [result.seed for result in results]))
        return results

    monkeypatch.setattr(module, "evaluate", evaluate)
    module.played = played
    return module


def test_every_size_is_a_row_of_the_same_episodes(curves, tmp_path):
    arguments = curves.Arguments(
        tmp_path / "runs", tmp_path / "a.csv", (fake.TASKS[0],), ("pose_error_deg", "cameras"), 3
    )
    curves.main(arguments)
    with arguments.out.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["size"] for row in rows] == ["0", "10", "20", "40", "1", "2", "3"]
    assert [row["pose"] for row in rows] == ["oracle"] * 4 + ["estimated"] * 3
    configs = [config for config, _ in curves.played]
    assert configs[2].errors == InjectedErrors(pose_error_deg=20)
    assert configs[4].errors.cameras == ("front",) and configs[6].errors == InjectedErrors()
    seeds = [own for _, own in curves.played]
    assert all(own == seeds[0] for own in seeds)
    curves.main(arguments)
    assert len(curves.played) == 7, "complete runs were repeated"


def test_an_unknown_error_is_named(curves, tmp_path):
    with pytest.raises(InputError, match="pose_error_deg"):
        curves.Arguments(tmp_path, tmp_path / "a.csv", errors=("pose_error_degs",))
