"""Fetching from a local server: whole, cut, changed, refused, hostile; nothing leaves the machine."""

import hashlib
import json
import os
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
import scan_files as files

from asset_pipeline import download as download_module
from asset_pipeline.build import SOURCES
from asset_pipeline.download import DownloadSettings, download
from asset_pipeline.fetch import fetch, read_checksums
from asset_pipeline.fetch_record import RECORD
from asset_pipeline.publishers import PUBLISHERS
from asset_pipeline.sources import google_scanned_objects as gso
from asset_pipeline.sources import ycb
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError

QUICK = DownloadSettings(timeout=5.0, attempts=3, pause=0.01)
YCB_REAL = (
    Path(os.environ.get("MANIPOSE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
    / "ycb"
    / "037_scissors_google_16k.tgz"
)


class Site:
    """What the server has and how it misbehaves.

    Attributes:
      files: By path.
      cut: Bytes after which it hangs up, one number a request; None for all.
      tagged: Whether it says which version a file is.
      ranges: Whether it honours `Range`.
      stubborn: It sends a part of the new file where `If-Range` names the old one.
      errors: Status codes to answer with first.
      asked: Method, path and `Range` of what was asked for.
    """

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.cut: list[int | None] = []
        self.errors: list[int] = []
        self.tagged = self.ranges = True
        self.stubborn = self.silent = False
        self.asked: list[tuple[str, str | None]] = []

    def tag(self, path: str) -> str:
        return f'"{hashlib.md5(self.files[path]).hexdigest()}"'


class Handler(BaseHTTPRequestHandler):
    site: Site

    def do_GET(self) -> None:
        site, path = self.site, unquote(urlsplit(self.path).path)
        site.asked.append((self.path, self.headers.get("Range")))
        if site.errors:
            self.send_error(site.errors.pop(0))
            return
        if path not in site.files:
            self.send_error(404)
            return
        body, start = site.files[path], 0
        wanted = self.headers.get("Range")
        same = self.headers.get("If-Range") in (None, site.tag(path)) or site.stubborn
        if wanted and site.ranges and same:
            start = int(wanted.removeprefix("bytes=").rstrip("-"))
            if start >= len(body):
                self.send_error(416)
                return
        self.send_response(206 if start else 200)
        if start:
            self.send_header("Content-Range", f"bytes {start}-{len(body) - 1}/{len(body)}")
        if not site.silent:
            self.send_header("Content-Length", str(len(body) - start))
        if site.tagged:
            self.send_header("ETag", site.tag(path))
        self.end_headers()
        cut = site.cut.pop(0) if site.cut else None
        self.wfile.write(body[start:] if cut is None else body[start : start + cut])
        self.close_connection = True

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def server():
    site = Site()
    handler = type("SiteHandler", (Handler,), {"site": site})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as http:
        thread = threading.Thread(target=http.serve_forever, args=(0.02,), daemon=True)
        thread.start()
        site.url = f"http://127.0.0.1:{http.server_port}"
        yield site
        http.shutdown()
        thread.join()


def _archive(folder: Path, seed: int = 0, ending: str = "tgz", size: int = 400_000) -> bytes:
    """A scan's archive, of noise so that it stays large."""
    noise = np.random.default_rng(seed).bytes(size)
    path = folder / f"made-{seed}.{ending}"
    content = {"037_scissors/google_16k/textured.obj": files.obj(files.box((0.1, 0.1, 0.1)))}
    data = files.write_archive(path, content | {"noise": noise}).read_bytes()
    path.unlink()
    return data


def _tree(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*")}


def _get(server: Site, target: Path, **more) -> str:
    return download(f"{server.url}/a.tgz", target, settings=QUICK, **more)


@pytest.fixture
def target(tmp_path):
    (tmp_path / "out").mkdir()
    return tmp_path / "out" / "a.tgz"


def test_whole_file_in_one_go(server, target, tmp_path):
    server.files["/a.tgz"] = data = _archive(tmp_path)
    seen = []
    got = _get(server, target, progress=lambda done, total: seen.append((done, total)))
    assert target.read_bytes() == data and got == hashlib.sha256(data).hexdigest()
    assert seen[-1] == (len(data), len(data)) and len(seen) > 1
    assert _tree(target.parent) == {"a.tgz"} and len(server.asked) == 1


@pytest.mark.parametrize("ending", ["tgz", "zip"])
def test_cut_connections_are_taken_up_where_they_broke(server, target, tmp_path, ending):
    server.files["/a.tgz"] = data = _archive(tmp_path, ending=ending)
    server.cut = [100_000, 50_000, None]
    _get(server, target)
    assert target.read_bytes() == data
    ranges = [r for _, r in server.asked]
    assert ranges == [None, "bytes=100000-", "bytes=150000-"]


def test_a_later_run_goes_on(server, target, tmp_path):
    server.files["/a.tgz"] = data = _archive(tmp_path)
    server.cut = [100_000, 0, 0, 0]
    with pytest.raises(InputError, match="100000 bytes are kept, run again to go on"):
        _get(server, target)
    assert _tree(target.parent) == {"a.tgz.part", "a.tgz.part.json"}
    server.asked.clear()
    _get(server, target)
    assert target.read_bytes() == data and server.asked == [("/a.tgz", "bytes=100000-")]


def test_interruption_leaves_no_file_under_the_final_name(server, target, tmp_path):
    server.files["/a.tgz"] = data = _archive(tmp_path)
    server.cut = [300_000, None]  # or the whole file may be there before the interruption

    def interrupt(done: int, _: int | None) -> None:
        if done > 200_000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _get(server, target, progress=interrupt)
    assert _tree(target.parent) == {"a.tgz.part", "a.tgz.part.json"}
    _get(server, target)
    assert target.read_bytes() == data and server.asked[-1][1] is not None


@pytest.mark.parametrize("stubborn", [False, True])
def test_file_that_changed_on_the_server_starts_again(server, target, tmp_path, stubborn):
    server.files["/a.tgz"] = _archive(tmp_path)
    server.cut = [100_000, 0, 0, 0]
    with pytest.raises(InputError):
        _get(server, target)
    server.files["/a.tgz"] = data = _archive(tmp_path, seed=1, size=500_000)
    server.stubborn = stubborn
    _get(server, target)
    assert target.read_bytes() == data


@pytest.mark.parametrize("trouble", ["untagged", "no ranges"])
def test_server_that_cannot_resume(server, target, tmp_path, trouble):
    server.files["/a.tgz"] = data = _archive(tmp_path)
    server.cut = [100_000, None]
    server.tagged = trouble != "untagged"
    server.ranges = trouble != "no ranges"
    _get(server, target)
    assert target.read_bytes() == data
    assert server.asked[1][1] == (None if trouble == "untagged" else "bytes=100000-")


def test_server_that_does_not_say_how_much_comes(server, target, tmp_path):
    server.files["/a.tgz"] = data = _archive(tmp_path)
    server.silent = True
    _get(server, target)
    assert target.read_bytes() == data
    target.unlink()
    server.cut = [len(data) // 2]
    with pytest.raises(InputError, match="truncated"):
        _get(server, target)
    assert not _tree(target.parent)


def test_complete_part_is_not_fetched_again(server, target, tmp_path, monkeypatch):
    server.files["/a.tgz"] = data = _archive(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(download_module, "sha256", lambda _: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            _get(server, target)
    _get(server, target)
    assert target.read_bytes() == data and len(server.asked) == 1


def test_passing_errors_are_waited_for_and_lasting_ones_named(server, target, tmp_path):
    server.files["/a.tgz"] = data = _archive(tmp_path)
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
    assert not _tree(target.parent)


def test_what_is_no_archive_or_another_file_is_not_kept(server, target, tmp_path):
    server.files["/a.tgz"] = b"<html>please log in</html>" * 100
    with pytest.raises(InputError, match="truncated, or not a zip"):
        _get(server, target)
    server.files["/a.tgz"] = data = _archive(tmp_path)
    with pytest.raises(InputError, match="expected " + "0" * 64):
        _get(server, target, digest="0" * 64)
    assert not _tree(target.parent)
    _get(server, target, digest=hashlib.sha256(data).hexdigest().upper())


@pytest.mark.parametrize("url", ["file:///etc/passwd", "ftp://x/a.tgz", "/etc/passwd"])
def test_only_http(target, url):
    with pytest.raises(InputError, match="http or https"):
        download(url, target)


def test_nobody_there(target):
    with pytest.raises(InputError, match="cannot be reached"):
        download("http://127.0.0.1:9/a.tgz", target, settings=QUICK)


def test_full_disk(server, target, tmp_path, monkeypatch):
    server.files["/a.tgz"] = _archive(tmp_path)
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


def _publish(server: Site, folder: Path, *names: str) -> dict[str, bytes]:
    found = {name: _archive(folder, seed=i, size=2000) for i, name in enumerate(names)}
    server.files |= {f"/{name}_google_16k.tgz": data for name, data in found.items()}
    return found


def test_fetch_keeps_a_record_and_checks_it(server, tmp_path):
    published = _publish(server, tmp_path, "037_scissors", "024_bowl")
    out = tmp_path / "out"
    positions = []
    results = fetch(
        "ycb", out, only=sorted(published), mirror=server.url + "/", progress=positions.append
    )
    assert [(r.name, r.status) for r in results] == [(n, "fetched") for n in sorted(published)]
    assert [(p.name, p.number, p.count) for p in positions][-1] == ("037_scissors", 2, 2)
    record = json.loads((out / RECORD).read_text())
    entry = record["files"]["037_scissors_google_16k.tgz"]
    assert entry == {
        "source": "ycb",
        "licence": "CC BY 4.0",
        "home": PUBLISHERS["ycb"].home,
        "url": f"{server.url}/037_scissors_google_16k.tgz",
        "bytes": len(published["037_scissors"]),
        "sha256": hashlib.sha256(published["037_scissors"]).hexdigest(),
    }
    server.asked.clear()
    again = fetch("ycb", out, only=sorted(published), mirror=server.url)
    assert {r.status for r in again} == {"present"} and not server.asked
    (out / "024_bowl_google_16k.tgz").write_bytes(published["037_scissors"])
    bowl, scissors = fetch("ycb", out, only=sorted(published), mirror=server.url)
    assert (bowl.status, scissors.status) == ("failed", "present")
    assert "fetched.json says" in bowl.reason and "delete it" in bowl.reason
    # What was fetched is what the reader reads.
    item = next(i for i in ycb.items(out) if i.name == "037_scissors")
    with ycb.opened(item) as scan:
        assert scan.category == "scissor"


def test_file_that_nobody_noted_is_checked_and_noted(server, tmp_path):
    published = _publish(server, tmp_path, "024_bowl")
    out = tmp_path / "out"
    fetch("ycb", out, only=["024_bowl"], mirror=server.url)
    (out / RECORD).unlink()
    assert fetch("ycb", out, only=["024_bowl"], mirror=server.url)[0].status == "present"
    assert "024_bowl_google_16k.tgz" in json.loads((out / RECORD).read_text())["files"]
    (out / RECORD).unlink()
    (out / "024_bowl_google_16k.tgz").write_bytes(published["024_bowl"][:500])
    assert fetch("ycb", out, only=["024_bowl"], mirror=server.url)[0].status == "failed"


def test_absent_file_fails_only_where_it_was_asked_for(server, tmp_path):
    _publish(server, tmp_path, "024_bowl")
    results = {r.name: r for r in fetch("ycb", tmp_path / "a", mirror=server.url)}
    assert len(results) == len(ycb.OBJECTS) and results["024_bowl"].status == "fetched"
    assert results["025_mug"].status == "absent"
    (mug,) = fetch("ycb", tmp_path / "a", only=["025_mug"], mirror=server.url)
    assert mug.status == "failed" and "HTTP 404" in mug.reason
    with pytest.raises(InputError, match="did you mean 025_mug"):
        fetch("ycb", tmp_path / "a", only=["025_mugg"], mirror=server.url)


def test_checksums_file(server, tmp_path):
    data = _publish(server, tmp_path, "024_bowl")["024_bowl"]
    sums = tmp_path / "SHA256SUMS"
    sums.write_text(f"{'0' * 64}  ./ycb/024_bowl_google_16k.tgz\n\n")
    (bowl,) = fetch("ycb", tmp_path / "a", only=["024_bowl"], mirror=server.url, checksums=sums)
    assert bowl.status == "failed" and "expected 0000" in bowl.reason
    assert _tree(tmp_path / "a") == {RECORD}
    sums.write_text(f"{hashlib.sha256(data).hexdigest()} *024_bowl_google_16k.tgz\n")
    (bowl,) = fetch("ycb", tmp_path / "a", only=["024_bowl"], mirror=server.url, checksums=sums)
    assert bowl.status == "fetched"
    sums.write_text("024_bowl\n")
    with pytest.raises(InputError, match="line 1: expected"):
        read_checksums(sums)


def test_the_publishers_own_list_is_followed(server, tmp_path):
    names = ["Acme_Mug", "Acme Bowl (blue)"]
    zipped = files.write_archive(
        tmp_path / "m.zip", {"meshes/model.obj": files.obj(files.box((0.1, 0.1, 0.1)))}
    ).read_bytes()
    server.files |= {f"/models/{name}.zip": zipped for name in names}
    server.files["/models"] = json.dumps([{"name": n, "likes": 3} for n in names]).encode()
    out = tmp_path / "out"
    results = fetch("google_scanned_objects", out, mirror=f"{server.url}/models")
    assert [r.status for r in results] == ["fetched", "fetched"]
    # A list that does not turn its pages ends where it brings nothing new.
    assert [p for p, _ in server.asked][:2] == [f"/models?per_page=100&page={i}" for i in (1, 2)]
    assert [i.name for i in gso.items(out)] == sorted(names)


@pytest.mark.parametrize(
    "name", ["../evil", "/etc/evil", "a/../../evil", "", ".evil", "x\n", "a\\b"]
)
def test_hostile_names_write_nothing(server, tmp_path, name):
    server.files["/models"] = json.dumps([{"name": "Mug"}, {"name": name}]).encode()
    for only in ((), (name,)) if name else ((),):
        with pytest.raises(InputError, match="no name of an object") as error:
            fetch(
                "google_scanned_objects", tmp_path / "o", only=only, mirror=f"{server.url}/models"
            )
        assert "\n" not in str(error.value)
    assert not _tree(tmp_path)


@pytest.mark.parametrize("listing", [b"<html>", b'{"name": "x"}', b'[{"title": "x"}]', b"[]", None])
def test_list_that_is_none(server, tmp_path, listing):
    if listing is not None:
        server.files["/models"] = listing
    with pytest.raises(InputError, match="list"):
        fetch("google_scanned_objects", tmp_path / "o", mirror=f"{server.url}/models")


def test_unwritable_out(server, tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        fetch("ycb", tmp_path / "out", only=["024_bowl"], mirror=server.url)
    assert not server.asked
    (tmp_path / "o").mkdir()
    (tmp_path / "o" / RECORD).write_text("{")
    with pytest.raises(InputError, match="fetched.json"):
        fetch("ycb", tmp_path / "o", only=["024_bowl"], mirror=server.url)


def test_gated_sources_say_how(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("omniobject3d", "partnet_mobility"):
        with pytest.raises(InputError, match="may not be downloaded unasked"):
            fetch(name, tmp_path)
        assert main(["assets", "fetch", name]) == 2
        printed = capsys.readouterr().out
        assert "register at https://" in printed and PUBLISHERS[name].licence in printed
    assert not _tree(tmp_path)
    assert set(SOURCES) <= set(PUBLISHERS)


def test_command(server, tmp_path, capsys):
    _publish(server, tmp_path, "024_bowl")
    arguments = ["assets", "fetch", "ycb", "--out", str(tmp_path / "o"), "--mirror", server.url]
    assert main([*arguments, "--only", "024_bowl"]) == 0
    printed = capsys.readouterr()
    assert "1 fetched, 0 there already, 0 failed" in printed.out and "CC BY 4.0" in printed.out
    assert main([*arguments, "--only", "025_mug"]) == 2
    assert "HTTP 404" in capsys.readouterr().err
    assert main(["assets", "fetch", "ycbs"]) == 2
    assert "did you mean ycb" in capsys.readouterr().err


@pytest.mark.skipif(not YCB_REAL.is_file(), reason=f"no {YCB_REAL}; set MANIPOSE_REAL_DATA")
def test_real_scan_comes_through_a_bad_line(server, tmp_path):
    data = YCB_REAL.read_bytes()
    server.files[f"/{YCB_REAL.name}"] = data
    server.cut = [len(data) // 3, len(data) // 3, None]
    (result,) = fetch(
        "ycb", tmp_path / "o", only=["037_scissors"], mirror=server.url, settings=QUICK
    )
    assert result.status == "fetched" and result.path.read_bytes() == data
    with ycb.opened(ycb.items(tmp_path / "o")[0]) as scan:
        assert 0.15 < scan.mesh.extents.max() < 0.25
