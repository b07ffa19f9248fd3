"""The first start is timed by stage, in a process of its own."""

from __future__ import annotations

import importlib


def test_a_start_of_engine_c_has_a_time_for_every_stage(tmp_path):
    script = importlib.import_module("first_start")
    task = "articulated/open_middle_drawer"
    arguments = [task, "--engine", "c", "--worlds", "1", "--starts", "1", "--one"]
    cells = script.row("empty", str(tmp_path), arguments).strip("| ").split(" | ")
    assert cells[0] == "empty" and cells[-1] == "-"
    *stages, whole = map(float, cells[1:-1])
    assert len(stages) + 1 == len(script.STAGES)
    assert abs(sum(stages) - whole) < 0.5
    failed = script.row("empty", str(tmp_path), ["no/such", "--engine", "c", "--one"])
    assert failed.startswith("| empty | failed: ")
