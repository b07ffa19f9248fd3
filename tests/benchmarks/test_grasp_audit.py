"""The published audit counts by category and reads what the trials left."""

import importlib
import json
import sys

import pytest


@pytest.fixture(scope="module")
def audit():
    return importlib.import_module("grasp_audit")


def test_a_line_for_each_category_and_one_for_all(audit):
    rows = [
        audit.Audited("mug_000", "mug", 24, 24),
        audit.Audited("mug_001", "mug", 19, 60),
        audit.Audited("bowl_000", "bowl", 20, 30),
    ]
    assert audit.table(rows) == [
        ("bowl", "1", "100%", "20", "30"),
        ("mug", "2", "50%", "21.5", "42"),
        ("all", "3", "67%", "20", "30"),
    ]


def test_the_record_lists_whole_categories_by_index(audit, monkeypatch):
    category = audit.CATALOGUE["mug"]
    monkeypatch.setattr(audit, "CATALOGUE", {"mug": category, "bowl": audit.CATALOGUE["bowl"]})
    rows = [
        audit.Audited(category.instance(i), "mug", i % 25, 60)
        for i in reversed(range(category.instances))
    ]
    held = audit.record(rows)["held"]
    assert held == {"mug": [i % 25 for i in range(category.instances)]}


def test_the_script_reads_assets_and_writes_a_table(audit, tmp_path, monkeypatch, capsys):
    from asset_pipeline.catalogue.instance import build

    build("box", 0, tmp_path / "assets" / "box_000")
    table, numbers = tmp_path / "audit.md", tmp_path / "audit.json"
    arguments = ["audit", str(tmp_path / "assets"), "--markdown", str(table)]
    monkeypatch.setattr(sys, "argv", [*arguments, "--record", str(numbers)])
    audit.main()
    assert "box" in capsys.readouterr().out
    assert "| box | 1 | 100% | 20 | 20 |" in table.read_text() and "mujoco" in table.read_text()
    assert json.loads(numbers.read_text()) == {"held": {}}
