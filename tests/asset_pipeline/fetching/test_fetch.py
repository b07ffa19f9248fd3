"""Fetching data sets from a local server: by list, with a record, hostile names; nothing leaves the machine."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

import tests.asset_pipeline.scan_files as files
from asset_pipeline.build.data_set import SOURCES
from asset_pipeline.fetching.download import DownloadSettings
from asset_pipeline.fetching.fetch_record import RECORD
from asset_pipeline.fetching.publishers import PUBLISHERS
from asset_pipeline.fetching.scan_files import fetch, read_checksums
from asset_pipeline.sources import google_scanned_objects as gso
from asset_pipeline.sources import ycb
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from tests.asset_pipeline.fetching.scan_site import Site, archive, tree
from tests.places import REAL_DATA

QUICK = DownloadSettings(timeout=5.0, attempts=3, pause=0.01)
YCB_REAL = REAL_DATA / "ycb" / "037_scissors_google_16k.tgz"


def _publish(server: Site, folder: Path, *names: str) -> dict[str, bytes]:
    found = {name: archive(folder, seed=i, size=2000) for i, name in enumerate(names)}
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
        "homepage": PUBLISHERS["ycb"].homepage,
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
    assert tree(tmp_path / "a") == {RECORD}
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
    assert not tree(tmp_path)


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
    assert not tree(tmp_path)
    assert set(SOURCES) - {"meshes"} <= set(PUBLISHERS)  # one's own


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
