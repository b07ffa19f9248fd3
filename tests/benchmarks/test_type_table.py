"""The table of type networks leaves out what exists, and tells when its bars are missed."""

from __future__ import annotations

import importlib

import pytest

from manipose_mj.ppf_jax.evaluation.pose_predictions import RIGID_TYPES, categories_of


@pytest.fixture(scope="module")
def table():
    return importlib.import_module("type_table")


def _row(table, category, seen, deg, cm):
    return table.Row("axial", category, seen, 10, deg, 2 * deg, cm, 2 * cm, deg, 0.0)


@pytest.mark.parametrize("name", RIGID_TYPES)
def test_six_of_each_type_are_left_out(table, name, capsys):
    left_out = table.LEFT_OUT[name]
    assert len(set(left_out)) == 6 and set(left_out) < set(categories_of(name))
    assert table.main(["--leave-out", name]) == 0
    assert capsys.readouterr().out.split() == list(left_out)


def test_bars(table):
    seen = [_row(table, "bowl", True, 1.0, 0.2), _row(table, "can", True, 3.0, 0.4)]
    near, far = (_row(table, "jar", False, deg, 0.5) for deg in (3.9, 4.1))
    verdict = table.verdict_of([*seen, near])
    assert verdict.seen == pytest.approx((2.0, 0.3)) and verdict.unseen == pytest.approx((3.9, 0.5))
    assert table.missed([*seen, near], [verdict]) == []
    assert table.missed([*seen, far], [table.verdict_of([*seen, far])]) == [
        "unseen axial categories"
    ]
    worse = [*seen, _row(table, "vase", True, 5.0, 0.2)]
    assert "3.00 deg" in table.missed(worse, [table.verdict_of(worse)])[0]


def test_no_weights_is_one_line(table, tmp_path, capsys):
    assert table.main(["--types", "axial", "--weights", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
