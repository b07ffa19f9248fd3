"""The comparison with MuJoCo Playground times its runners in turns, and leaves out what does not run."""

from __future__ import annotations

import argparse
import importlib

import pytest

from manipose_mj.batch.drawing import draw_pool
from manipose_mj.tasks.core.config import EnvConfig


@pytest.fixture
def comparison():
    return importlib.import_module("playground_comparison")


def asked(comparison, **options):
    """The arguments of a comparison of two control steps."""
    usual = {"objects": ["box_000"], "pool": None, "modes": comparison.MODES, "no_mjx": False}
    return argparse.Namespace(steps=2, **usual | options)


def test_runners_run_in_turns(comparison):
    order: list[str] = []
    runners = [
        comparison.Runner(name, lambda name=name: order.append(name), 10, lambda: None)
        for name in ("a", "b")
    ]
    rates = comparison.in_turns(runners)
    assert order == ["a", "b"] * comparison.TURNS and set(rates) == {"a", "b"}


def test_what_playground_lacks_is_left_out_in_a_line(comparison, monkeypatch, capsys):
    own = comparison.ours(2, ("box_000",), 2, engine="c")
    monkeypatch.setattr(comparison, "ours", lambda *_: own)

    def absent(*_):
        raise ModuleNotFoundError("No module named 'mujoco_playground'")

    monkeypatch.setattr(comparison, "playground", absent)
    monkeypatch.setattr(comparison, "TURNS", 1)
    comparison.compare(2, asked(comparison))
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "left out: ModuleNotFoundError: No module named 'mujoco_playground'"
    assert out[-1].startswith("| 2 | ours | ") and "| 1.00 |" in out[-1]


def test_ours_is_compared_with_playground_and_not_with_mjx_on_our_scene(
    comparison, monkeypatch, capsys
):
    def fake(name):
        return lambda *_: comparison.Runner(name, lambda: None, 10, lambda: None)

    monkeypatch.setattr(comparison, "ours", fake("ours"))
    monkeypatch.setattr(
        comparison, "playground", lambda _, mode, *__: fake(f"Playground, {mode}")()
    )
    monkeypatch.setattr(comparison, "mjx_of_ours", fake("MJX on our scene"))
    rates = {"ours": 3.0, "Playground, WARP": 2.0, "MJX on our scene": 9.0}
    monkeypatch.setattr(
        comparison, "in_turns", lambda all_: {one.name: rates.get(one.name, 1.0) for one in all_}
    )
    comparison.compare(2, asked(comparison))
    out = capsys.readouterr()
    assert out.out.splitlines()[-1] == "2 worlds: 1.50 times the best of Playground"
    assert "MJX on our scene: first turn after" in out.err


def test_modes_and_mjx_can_be_left_out(comparison, monkeypatch, capsys):
    made = []

    def fake(name):
        return lambda *_: (made.append(name), comparison.Runner(name, lambda: None, 10, int))[1]

    monkeypatch.setattr(comparison, "ours", fake("ours"))
    monkeypatch.setattr(comparison, "playground", lambda _, mode, *__: fake(f"{mode}")())
    monkeypatch.setattr(comparison, "mjx_of_ours", fake("MJX on our scene"))
    comparison.compare(2, asked(comparison, modes=["WARP"], no_mjx=True))
    assert made == ["ours", "None", "WARP"]


def test_ours_can_be_of_drawn_starts(comparison, tmp_path):
    config = EnvConfig(comparison.TASK, objects=("box_000",), reward_mode="dense")
    draw_pool(config, range(2)).save(tmp_path / "pool")
    runner = comparison.ours(2, tmp_path / "pool", 2, engine="c")
    _, steps = runner.run()
    assert steps.reward.shape == (2, 2)
    runner.close()
