"""The comparison with MuJoCo Playground times its runners in turns, and leaves out what does not run."""

from __future__ import annotations

import argparse
import importlib

import pytest


@pytest.fixture
def comparison():
    return importlib.import_module("playground_comparison")


def test_runners_run_in_turns(comparison):
    order: list[str] = []
    runners = [
        comparison.Runner(name, lambda name=name: order.append(name), 10, lambda: None)
        for name in ("a", "b")
    ]
    rates = comparison.in_turns(runners)
    assert order == ["a", "b"] * comparison.TURNS and set(rates) == {"a", "b"}


def test_what_playground_lacks_is_left_out_in_a_line(comparison, monkeypatch, capsys):
    own = comparison.ours(2, ["box_000"], 2, engine="c")
    monkeypatch.setattr(comparison, "ours", lambda *_: own)

    def absent(*_):
        raise ModuleNotFoundError("No module named 'mujoco_playground'")

    monkeypatch.setattr(comparison, "playground", absent)
    monkeypatch.setattr(comparison, "TURNS", 1)
    comparison.compare(2, argparse.Namespace(objects=["box_000"], steps=2))
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "left out: ModuleNotFoundError: No module named 'mujoco_playground'"
    assert out[-1].startswith("| 2 | ours | ") and "| 1.00 |" in out[-1]
