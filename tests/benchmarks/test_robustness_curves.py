"""The sweep over errors plays the same episodes at every size, and goes on where it was interrupted."""

from __future__ import annotations

import csv
import importlib
import re

import pytest
import tyro

import tests.evaluation.fake_episodes as fake
from manipose_mj.control.perception.perturbed import UNPERTURBED
from manipose_mj.errors import InputError
from manipose_mj.evaluation.injected_errors import InjectedErrors
from tests.docs.pages import DOCS, read


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


TABLE = DOCS / "plots" / "robustness.csv"


def rows_of(path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_curves_that_are_not_measured_stay(curves, tmp_path):
    out = tmp_path / "a.csv"
    out.write_bytes(TABLE.read_bytes())
    before = rows_of(out)
    task = (fake.TASKS[0],)
    curves.main(curves.Arguments(tmp_path / "runs", out, task, ("latency_ms",), 2, sizes=(50.0,)))
    after = rows_of(out)
    measured = [row for row in after if row["episodes"] == "2"]
    assert [(row["error"], row["size"]) for row in measured] == [
        ("latency_ms", "0"),
        ("latency_ms", "50"),
    ]
    stay = [row for row in before if (row["task"], row["error"]) != (*task, "latency_ms")]
    assert [row for row in after if row not in measured] == stay


def test_curves_of_an_estimator_are_its_own(curves, tmp_path):
    out = tmp_path / "a.csv"
    for number, estimator in enumerate((None, "tests.estimators.answers:Middle")):
        curves.main(
            curves.Arguments(
                *(tmp_path / str(number), out, (fake.TASKS[0],), ("cameras",), 2),
                sizes=(1.0,),
                estimator=estimator,
            )
        )
    assert [(row["size"], row["estimator"]) for row in rows_of(out)] == [
        *(("1", ""), ("3", "")),
        *((size, "tests.estimators.answers:Middle") for size in "13"),
    ]


def test_a_table_is_whole_or_as_it_was(curves, tmp_path, monkeypatch):
    out = tmp_path / "a.csv"
    out.write_bytes(TABLE.read_bytes())

    def refuses(config, resume):
        raise InputError("results of another estimator")

    monkeypatch.setattr(curves, "evaluate", refuses)
    with pytest.raises(InputError, match="another estimator"):
        curves.main(curves.Arguments(tmp_path / "runs", out))
    assert out.read_bytes() == TABLE.read_bytes()
    out.write_text("mine\n1\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"a.csv: columns are 'mine'; choose another --out"):
        curves.main(curves.Arguments(tmp_path / "runs", out))


def test_the_page_tells_the_commands_of_its_table(curves):
    page = read(DOCS / "experiments" / "robustness.md")
    rows = []
    for words in re.findall(r"^curve (--.*)$", page, re.MULTILINE):
        given = tyro.cli(curves.Arguments, args=[*words.split(), "--runs", "r", "--out", "o"])
        for task in given.tasks:
            for error in given.errors:
                sizes = {curves.USUAL.get(error, 0.0), *(given.sizes or curves.SIZES[error][1])}
                rows += [(task, error, f"{size:g}", str(given.episodes)) for size in sorted(sizes)]
    table = rows_of(TABLE)
    assert rows == [(r["task"], r["error"], r["size"], r["episodes"]) for r in table]


@pytest.mark.parametrize("error", ["pose_error_cm", "pose_error_deg"])
def test_at_size_0_the_simulator_need_not_tell_of_the_goal(curves, error):
    """The baseline is told whether it met the goal only where it acts on poses as they are."""
    told, not_told = (curves.injected(error, 0.0, second_attempt=told) for told in (True, False))
    assert told == InjectedErrors()
    assert told.pose_errors() == UNPERTURBED != not_told.pose_errors()
    assert not_told.pose_errors().error.translation < 1e-6
    assert curves.injected("latency_ms", 0.0, second_attempt=False) == InjectedErrors()
