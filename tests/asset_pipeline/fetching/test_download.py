"""Downloading from a local server: whole, cut, changed, refused; nothing leaves the machine."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from asset_pipeline.fetching import download as download_module
from asset_pipeline.fetching.download import DownloadSettings, download
from manipose_mj.errors import InputError
from tests.asset_pipeline.fetching.scan_site import Site, archive, tree

QUICK = DownloadSettings(timeout=5.0, attempts=3, pause=0.01)


def _get(server: Site, target: Path, **more) -> str:
    return download(f"{server.url}/a.tgz", target, settings=QUICK, **more)


@pytest.fixture
def target(tmp_path):
    (tmp_path / "out").mkdir()
    return tmp_path / "out" / "a.tgz"


def test_whole_file_in_one_go(server, target, tmp_path):
    server.files["/a.tgz"] = data = archive(tmp_path)
    seen = []
    got = _get(server, target, progress=lambda done, total: seen.append((done, total)))
    assert target.read_bytes() == data and got == hashlib.sha256(data).hexdigest()
    assert seen[-1] == (len(data), len(data)) and len(seen) > 1
    assert tree(target.parent) == {"a.tgz"} and len(server.asked) == 1


@pytest.mark.parametrize("ending", ["tgz", "zip"])
def test_cut_connections_are_taken_up_where_they_broke(server, target, tmp_path, ending):
    server.files["/a.tgz"] = data = archive(tmp_path, ending=ending)
    server.cut = [100_000, 50_000, None]
    _get(server, target)
    assert target.read_bytes() == data
    ranges = [r for _, r in server.asked]
    assert ranges == [None, "bytes=100000-", "bytes=150000-"]


def test_a_later_run_goes_on(server, target, tmp_path):
    server.files["/a.tgz"] = data = archive(tmp_path)
    server.cut = [100_000, 0, 0, 0]
    with pytest.raises(InputError, match="100000 bytes are kept, run again to go on"):
        _get(server, target)
    assert tree(target.parent) == {"a.tgz.part", "a.tgz.part.json"}
    server.asked.clear()
    _get(server, target)
    assert target.read_bytes() == data and server.asked == [("/a.tgz", "bytes=100000-")]


def test_interruption_leaves_no_file_under_the_final_name(server, target, tmp_path):
    server.files["/a.tgz"] = data = archive(tmp_path)
    server.cut = [300_000, None]  # or the whole file may be there before the interruption

    def interrupt(done: int, _: int | None) -> None:
        if done > 200_000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _get(server, target, progress=interrupt)
    assert tree(target.parent) == {"a.tgz.part", "a.tgz.part.json"}
    _get(server, target)
    assert target.read_bytes() == data and server.asked[-1][1] is not None


@pytest.mark.parametrize("stubborn", [False, True])
def test_file_that_changed_on_the_server_starts_again(server, target, tmp_path, stubborn):
    server.files["/a.tgz"] = archive(tmp_path)
    server.cut = [100_000, 0, 0, 0]
    with pytest.raises(InputError):
        _get(server, target)
    server.files["/a.tgz"] = data = archive(tmp_path, seed=1, size=500_000)
    server.stubborn = stubborn
    _get(server, target)
    assert target.read_bytes() == data


@pytest.mark.parametrize("trouble", ["untagged", "no ranges"])
def test_server_that_cannot_resume(server, target, tmp_path, trouble):
    server.files["/a.tgz"] = data = archive(tmp_path)
    server.cut = [100_000, None]
    server.tagged = trouble != "untagged"
    server.ranges = trouble != "no ranges"
    _get(server, target)
    assert target.read_bytes() == data
    assert server.asked[1][1] == (None if trouble == "untagged" else "bytes=100000-")


def test_server_that_does_not_say_how_much_comes(server, target, tmp_path):
    server.files["/a.tgz"] = data = archive(tmp_path)
    server.silent = True
    _get(server, target)
    assert target.read_bytes() == data
    target.unlink()
    server.cut = [len(data) // 2]
    with pytest.raises(InputError, match="truncated"):
        _get(server, target)
    assert not tree(target.parent)


def test_complete_part_is_not_fetched_again(server, target, tmp_path, monkeypatch):
    server.files["/a.tgz"] = data = archive(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(download_module, "sha256", lambda _: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            _get(server, target)
    _get(server, target)
    assert target.read_bytes() == data and len(server.asked) == 1


def test_passing_errors_are_waited_for_and_lasting_ones_named(server, target, tmp_path):
    server.files["/a.tgz"] = data = archive(tmp_path)
    server.errors = [503, 429]
    _get(server, target)
    assert target.read_bytes() == data
    target.unlink()
    server.errors = [503] * 9
    with pytest.raises(InputError, match="cannot be downloaded .HTTP 503"):
        _get(server, target)
    server.errors = [403]
    with pytest.raises(InputError, match="refused .HTTP 403"):
        _get(server, target)
    assert not tree(target.parent)


def test_what_is_no_archive_or_another_file_is_not_kept(server, target, tmp_path):
    server.files["/a.tgz"] = b"<html>please log in</html>" * 100
    with pytest.raises(InputError, match="truncated, or not a zip"):
        _get(server, target)
    server.files["/a.tgz"] = data = archive(tmp_path)
    with pytest.raises(InputError, match="expected " + "0" * 64):
        _get(server, target, digest="0" * 64)
    assert not tree(target.parent)
    _get(server, target, digest=hashlib.sha256(data).hexdigest().upper())


@pytest.mark.parametrize("url", ["file:///etc/passwd", "ftp://x/a.tgz", "/etc/passwd"])
def test_only_http(target, url):
    with pytest.raises(InputError, match="http or https"):
        download(url, target)


def test_nobody_there(target):
    with pytest.raises(InputError, match="cannot be reached"):
        download("http://127.0.0.1:9/a.tgz", target, settings=QUICK)


def test_full_disk(server, target, tmp_path, monkeypatch):
    server.files["/a.tgz"] = archive(tmp_path)
    with monkeypatch.context() as patch:
        usage = type("Usage", (), {"free": 1000})
        patch.setattr(download_module.shutil, "disk_usage", lambda _: usage)
        with pytest.raises(InputError, match="MB free; make room"):
            _get(server, target)
    if Path("/dev/full").exists():
        target.with_name("a.tgz.part").symlink_to("/dev/full")
        with pytest.raises(InputError, match="cannot be written .No space left"):
            _get(server, target)
    assert not target.exists()
