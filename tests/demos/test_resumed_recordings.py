"""Recordings that go on: after an interruption, and to more episodes than a set has."""

from __future__ import annotations

import pytest

from manipose_mj.demos import record as recording
from manipose_mj.demos.layout import find_sets, read_actions, read_set
from manipose_mj.demos.record import record
from manipose_mj.errors import InputError
from tests.demos.recordings import attempting, config


def test_the_first_successes_are_kept_whatever_was_interrupted(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "_attempt", attempting)
    whole = record(config(tmp_path / "whole", episodes=5))
    assert [each.elapsed_steps for each in whole.episodes] == [1, 3, 4, 6, 7]

    def interrupted(config, number, seed):
        if number == 3:
            raise KeyboardInterrupt
        return attempting(config, number, seed)

    monkeypatch.setattr(recording, "_attempt", interrupted)
    with pytest.raises(KeyboardInterrupt):
        record(config(tmp_path / "cut", episodes=5))
    calls = []

    def counted(config, number, seed):
        calls.append(number)
        return attempting(config, number, seed)

    monkeypatch.setattr(recording, "_attempt", counted)
    with pytest.raises(InputError, match="add --resume"):
        record(config(tmp_path / "cut", episodes=5))
    with pytest.raises(InputError, match="its attempts have seed 1, this run has 2"):
        record(config(tmp_path / "cut", episodes=5, seed=2), resume=True)
    again = record(config(tmp_path / "cut", episodes=5), resume=True)
    assert calls == [3, 4, 5, 6] and again.episodes == whole.episodes
    assert record(config(tmp_path / "cut", episodes=5), resume=True).episodes == whole.episodes
    with pytest.raises(InputError, match="holds 5 successes; add --resume for more"):
        record(config(tmp_path / "cut", episodes=6))
    with pytest.raises(InputError, match="recorded with another --seed"):
        record(config(tmp_path / "cut", episodes=5, seed=2), resume=True)
    with pytest.raises(InputError, match=r"its objects are \[.*this run has .*in their order"):
        record(config(tmp_path / "cut", episodes=5, objects=("mug_000",)), resume=True)


def test_a_set_is_extended(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "_attempt", attempting)
    whole = record(config(tmp_path / "whole", episodes=5))
    record(config(tmp_path / "grown", episodes=2))
    calls = []

    def counted(config, number, seed):
        calls.append(number)
        if number == 6 and calls.count(6) == 1:
            raise KeyboardInterrupt
        return attempting(config, number, seed)

    monkeypatch.setattr(recording, "_attempt", counted)
    asked = config(tmp_path / "grown", episodes=5)
    with pytest.raises(KeyboardInterrupt):
        record(asked, resume=True)
    assert len(read_set(asked.path).episodes) == 2  # nothing is lost, also not by asking for fewer
    record(config(tmp_path / "grown", episodes=2), resume=True)
    assert (asked.parts / "00004.json").is_file()
    assert record(asked, resume=True).episodes == whole.episodes
    assert calls == [3, 4, 5, 6, 6] and not asked.parts.exists()
    assert asked.path.read_bytes() == whole.path.read_bytes()
    assert read_set(asked.path).document == whole.document
    for each in whole.episodes:
        assert (read_actions(read_set(asked.path), each) == each.elapsed_steps - 1).all()


def test_a_set_is_extended_by_what_it_holds_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "_attempt", attempting)
    record(config(tmp_path / "successes", episodes=2))
    record(config(tmp_path / "both", episodes=2, failures=True))
    more = {"episodes": 3}
    with pytest.raises(InputError, match="lacks its failures; leave out --failures"):
        record(config(tmp_path / "successes", failures=True, **more), resume=True)
    with pytest.raises(InputError, match="holds failures too; add --failures"):
        record(config(tmp_path / "both", **more), resume=True)
    grown = record(config(tmp_path / "both", failures=True, **more), resume=True)
    assert [each.success for each in grown.episodes] == [True, False, True, True]
    monkeypatch.setattr(recording, "current_versions", lambda: {"mujoco": "0.1"})
    with pytest.raises(InputError, match="this run has {'mujoco': '0.1'}; choose another --out"):
        record(config(tmp_path / "successes", **more), resume=True)


def test_a_second_recording_in_the_same_folder_is_refused_while_one_runs(tmp_path, monkeypatch):
    told = []

    def disturbed(asked, number, seed):
        for resume in (False, True):
            with pytest.raises(InputError) as refusal:
                record(config(tmp_path, seed=2), resume=resume)
            told.append(str(refusal.value))
        return attempting(asked, number, seed)

    monkeypatch.setattr(recording, "_attempt", disturbed)
    demos = record(config(tmp_path))
    said = f"{demos.path.parent}: another recording is writing there; wait for it"
    assert set(told) == {said} and len(demos.episodes) == 2
    assert sorted(each.suffix for each in demos.path.parent.iterdir()) == [".h5", ".json"]
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write there"):
        record(config(tmp_path / "file"))


def test_a_set_of_other_builds_is_not_extended(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "_attempt", attempting)
    asset = tmp_path / "assets" / "mug" / "asset.json"
    asset.parent.mkdir(parents=True)
    asset.write_text('{"schema_version": 1, "name": "mug", "provenance": {"generator": "one"}}')
    objects = {"objects": (str(tmp_path / "assets"),)}
    record(config(tmp_path / "out", episodes=1, **objects))
    assert len(record(config(tmp_path / "out", episodes=2, **objects), resume=True).episodes) == 2
    assert len(find_sets(tmp_path / "out")) == 1
    asset.write_text('{"schema_version": 1, "name": "mug", "provenance": {"generator": "two"}}')
    with pytest.raises(InputError, match="its objects were built otherwise"):
        record(config(tmp_path / "out", episodes=3, **objects), resume=True)
    with pytest.raises(InputError, match="its objects were built otherwise; build them as they"):
        find_sets(tmp_path / "out")
