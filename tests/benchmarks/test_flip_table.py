"""The tables of flips count what they say, and the fit of confidence recovers a probability."""

from __future__ import annotations

import importlib
import json
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

from asset_pipeline.sources.scan import ScanItem
from manipose_mj.ppf_jax.confidence import FEATURES

fit_confidence, flip_table, scan_views = (
    importlib.import_module(name) for name in ("fit_confidence", "flip_table", "scan_views")
)


def _records(seed: int, count: int) -> list[Any]:
    """Of 20 scans; right with a probability that their first feature says, and twice too sure by score."""
    rng = np.random.default_rng(seed)
    odds = rng.normal(0.0, 2.0, count)
    right = rng.random(count) < 1 / (1 + np.exp(-odds))
    return [
        flip_table.Record(
            f"scan_{i % 20}",
            True,
            1,
            0.1 if r else 3.0,
            0.001,
            float(1 / (1 + np.exp(-2 * o))),
            0.5,
            (float(o), *rng.normal(size=len(FEATURES) - 1).tolist()),
        )
        for i, (o, r) in enumerate(zip(odds, right, strict=True))
    ]


def test_a_fit_gives_scans_that_it_has_not_seen_their_probability():
    records = _records(0, 2000)
    tested = fit_confidence.cross_validated(records, _records(1, 200), seed=0)
    confidence = np.array([record.confidence for record in tested])
    right = np.array([record.right for record in tested])
    assert len(tested) == len(records)
    for low, high in ((0.1, 0.4), (0.4, 0.7), (0.7, 0.95)):
        some = (confidence > low) & (confidence < high)
        assert right[some].mean() == pytest.approx(confidence[some].mean(), abs=0.06)


def test_records_are_read_as_they_were_written(tmp_path, capsys):
    path = tmp_path / "records.json"
    records = _records(0, 100)
    path.write_text(json.dumps([asdict(record) for record in records]))
    assert fit_confidence.main([str(path), "--out", str(tmp_path / "c.json")]) == 0
    assert "within 15 deg" in capsys.readouterr().out and (tmp_path / "c.json").is_file()
    assert fit_confidence.main([str(tmp_path / "none.json")]) == 2
    assert "no records of flip_table.py" in capsys.readouterr().err


def test_every_third_scan_is_kept_for_validation(tmp_path):
    items = [ScanItem(name, tmp_path) for name in "fbdaceg"]
    assert [item.name for item in scan_views.chosen(items, 3, 0)] == list("abdeg")
    assert [item.name for item in scan_views.chosen(items, 0, 3)] == list("cf")


def test_views_that_are_not_there_are_told_in_one_line(tmp_path, capsys):
    assert flip_table.main([str(tmp_path)]) == 2
    assert "no views of scans" in capsys.readouterr().err
    assert scan_views.main(["gso", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert "unknown source" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
