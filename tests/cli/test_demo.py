"""`manipose demo` replaces an earlier demo, and nothing of anybody who is at work in the folder."""

from __future__ import annotations

import pytest

from manipose_mj.cli.demo import MARK
from manipose_mj.cli.main import main
from manipose_mj.evaluation.results_folder import RESULTS_FILE, results_file


@pytest.fixture
def played(monkeypatch):
    """The results that each demo's evaluation finds in its folder; it plays nothing."""
    found = []

    def run(config, *, resume):
        found.append((config.out / RESULTS_FILE).read_bytes())
        return 0

    monkeypatch.setattr("manipose_mj.cli.demo.run_and_report", run)
    monkeypatch.setattr("manipose_mj.cli.builtin_objects.load_objects", lambda names, jobs: [])
    return found


def test_a_demo_at_work_keeps_its_folder(tmp_path, played, capsys):
    (tmp_path / MARK).touch()
    with results_file(tmp_path) as file:
        file.write(b"a result\n")
        file.flush()
        assert main(["demo", "--jobs", "1", "--out", str(tmp_path)]) == 2
    assert "another evaluation is writing there" in capsys.readouterr().err
    assert (tmp_path / RESULTS_FILE).read_bytes() == b"a result\n" and not played


def test_an_earlier_demo_is_replaced_and_other_results_are_not(tmp_path, played, capsys):
    demo, other = tmp_path / "demo", tmp_path / "other"
    other.mkdir()
    (other / RESULTS_FILE).write_bytes(b"a result\n")
    for out in (demo, demo):
        assert main(["demo", "--jobs", "1", "--out", str(out)]) == 0
        with results_file(out) as file:
            file.write(b"another\n")
    assert main(["demo", "--jobs", "1", "--out", str(other)]) == 2
    assert capsys.readouterr().err == (
        f"manipose: {other}: holds results that are not a demo's; choose another --out\n"
    )
    assert played == [b"", b""] and not (other / MARK).exists()
    assert (other / RESULTS_FILE).read_bytes() == b"a result\n"
