"""Records of what episodes do: written whole, and equal only where every entry is."""

from __future__ import annotations

import json
import sys

import pytest

from benchmarks import behaviour

EPISODE = "episode clutter/pick 0"


def _file(path, **entries):
    path.write_text(json.dumps(entries), encoding="utf-8")
    return path


@pytest.fixture
def command(monkeypatch, capsys):
    """Runs the script; gives its exit code and what it printed."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["behaviour.py", *map(str, arguments)])
        with pytest.raises(SystemExit) as done:
            behaviour.main()
        printed = capsys.readouterr()
        return done.value.code, printed.out + printed.err

    return run


@pytest.mark.parametrize(
    ("old", "new", "code", "said"),
    [
        ({"a": {"x": 1}}, {"a": {"x": 1}}, 0, "1 of 1 equal; in one file only: 0"),
        ({"a": {"x": 1}}, {"a": {"x": 2}}, 1, "a: x"),
        ({"a": {"x": 1}, "b": {}}, {"a": {"x": 1}}, 1, "before.json: b"),
        ({"a": {"x": 1}}, {"a": {"x": 1}, "c": {}}, 1, "after.json: c"),
        ({"a": {}}, {"b": {}}, 1, "0 of 0 equal; in one file only: 2"),
    ],
)
def test_records_are_equal_where_every_entry_is(tmp_path, command, old, new, code, said):
    paths = _file(tmp_path / "before.json", **old), _file(tmp_path / "after.json", **new)
    found, printed = command("compare", *paths)
    assert found == code and said in printed


@pytest.mark.parametrize("text", [None, "{", "[1]"])
def test_what_is_no_record_is_one_line(tmp_path, command, text):
    wrong = tmp_path / "wrong.json"
    if text is not None:
        wrong.write_text(text, encoding="utf-8")
    code, printed = command("compare", _file(tmp_path / "right.json"), wrong)
    assert code == 2 and printed.startswith(f"error: {wrong}: ") and printed.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("missing/out.json",), "expected a file in a folder that exists"),
        ((".",), "expected a file in a folder that exists"),
        (("out.json", "--only", "clutter/pikc"), "did you mean clutter/pick"),
        (("out.json", "--episodes", "0"), "episodes is 0; expected a whole number, at least 1"),
    ],
)
def test_wrong_options_are_told_before_anything_is_played(
    tmp_path, monkeypatch, command, options, said
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(behaviour, "played", None)
    code, printed = command("record", *options)
    assert code == 2 and said in printed and not any(tmp_path.iterdir())


def test_a_record_that_breaks_off_leaves_the_one_before(tmp_path, monkeypatch, command):
    out = _file(tmp_path / "out.json", before={})
    monkeypatch.setattr(behaviour, "played", lambda task, episode, pose: {"success": True})
    monkeypatch.setattr(behaviour, "wandered", lambda task, mode: {"rewards": [object()]})
    with pytest.raises(TypeError):
        behaviour.record(out, episodes=1, jobs=1, only=("clutter/pick",))
    assert json.loads(out.read_text(encoding="utf-8")) == {"before": {}}
    monkeypatch.setattr(behaviour, "wandered", lambda task, mode: {"rewards": []})
    behaviour.record(out, episodes=1, jobs=1, only=("clutter/pick",))
    assert EPISODE in json.loads(out.read_text(encoding="utf-8"))
    assert [path.name for path in tmp_path.iterdir()] == ["out.json"]
