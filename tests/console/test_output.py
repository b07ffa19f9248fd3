"""Figures of tables."""

from __future__ import annotations

from manipose_mj.console.output import figure


def test_what_no_figure_is_there_for_is_a_dash():
    assert [figure(v, ".0%") for v in (0.125, float("nan"), float("inf"))] == ["12%", "-", "-"]
