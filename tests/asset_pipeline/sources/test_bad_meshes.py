"""Unusable input gets one clear line and leaves nothing behind."""

import io
import tarfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from asset_pipeline.build.data_set import build
from asset_pipeline.sources.files.archives import extract
from asset_pipeline.sources.scan import check_mesh, load_scan_mesh
from manipose_mj.errors import InputError

BOX = "".join(
    f"v {x} {y} {z}\n" for x in (0, 0.05) for y in (0, 0.06) for z in (0, 0.07)
) + "".join(f"f {a} {b} {c}\n" for a, b, c in np.asarray(trimesh.creation.box().faces) + 1)


def _obj(folder: Path, text: str) -> Path:
    path = folder / "001_thing" / "google_16k" / "textured.obj"
    path.parent.mkdir(parents=True)
    path.write_text(text)
    return path


def _tgz(path: Path, members: list[tarfile.TarInfo], content: bytes = b"x") -> Path:
    with tarfile.open(path, "w:gz") as tar:
        for member in members:
            if member.isreg():
                member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
    return path


def _refused(archive: Path, folder: Path, match: str) -> None:
    before = set(folder.rglob("*")) | set(folder.parent.iterdir())
    with pytest.raises(InputError, match=match) as caught:
        extract(archive, folder / "out")
    assert str(archive) in str(caught.value) and "\n" not in str(caught.value)
    assert set(folder.rglob("*")) | set(folder.parent.iterdir()) == before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\n", "faces|cannot be read"),
        (BOX.replace("v 0 0 0\n", "v nan 0 0\n", 1), "NaN or infinite"),
        (BOX.replace("v 0 0 0\n", "v 0 inf 0\n", 1), "NaN or infinite"),
        ("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", "zero size"),
        (BOX.replace("0.0", ""), "millimetres"),
        (BOX.replace("0.0", "0.000"), "too small"),
        ("", "faces|cannot be read"),
    ],
)
def test_mesh_is_refused_by_name(tmp_path, text, message):
    path = _obj(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        load_scan_mesh(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_face_without_vertex_is_refused():
    mesh = trimesh.Trimesh(np.eye(3) * 0.1, [[0, 1, 2]], process=False)
    mesh.faces = [[0, 1, 7]]
    with pytest.raises(InputError, match="names vertex 7 of 3"):
        check_mesh(mesh, "here")


def test_missing_mesh_is_named(tmp_path):
    with pytest.raises(InputError, match="nothing.obj"):
        load_scan_mesh(tmp_path / "nothing.obj")


def test_good_archive_unpacks_whole(tmp_path):
    archive = _tgz(tmp_path / "a.tgz", [tarfile.TarInfo("x/y.txt"), tarfile.TarInfo("x/z.txt")])
    written = extract(archive, tmp_path / "out")
    assert [p.relative_to(tmp_path / "out").as_posix() for p in written] == ["x/y.txt", "x/z.txt"]
    assert all(p.read_bytes() == b"x" for p in written)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.98])
def test_truncated_archive(tmp_path, share):
    noise = np.random.default_rng(0).bytes(200_000)
    archive = _tgz(tmp_path / "a.tgz", [tarfile.TarInfo("x/mesh.obj")], noise)
    archive.write_bytes(archive.read_bytes()[: int(share * archive.stat().st_size)])
    (tmp_path / "in").mkdir()
    _refused(archive, tmp_path / "in", "truncated")


@pytest.mark.parametrize("content", [b"", b"no archive at all", b"\x1f\x8b" + b"\0" * 50])
def test_not_an_archive(tmp_path, content):
    archive = tmp_path / "a.tgz"
    archive.write_bytes(content)
    (tmp_path / "in").mkdir()
    _refused(archive, tmp_path / "in", "gzipped tar")


@pytest.mark.parametrize("name", ["../evil.txt", "x/../../evil.txt", "/tmp/evil.txt", "..\\evil"])
def test_escaping_path(tmp_path, name):
    archive = _tgz(tmp_path / "a.tgz", [tarfile.TarInfo("x/good.txt"), tarfile.TarInfo(name)])
    (tmp_path / "in").mkdir()
    _refused(archive, tmp_path / "in", "leaves the folder")


@pytest.mark.parametrize("kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.CHRTYPE])
def test_links_and_devices(tmp_path, kind):
    member = tarfile.TarInfo("x/link")
    member.type, member.linkname = kind, "/etc/passwd"
    archive = _tgz(tmp_path / "a.tgz", [member])
    (tmp_path / "in").mkdir()
    _refused(archive, tmp_path / "in", "expected files and folders only")


def test_absurd_size_is_refused_before_unpacking(tmp_path, monkeypatch):
    monkeypatch.setattr("asset_pipeline.sources.files.archives.MAX_FILE_BYTES", 1000)
    archive = _tgz(tmp_path / "a.tgz", [tarfile.TarInfo("x/bomb")], b"\0" * 10_000)
    (tmp_path / "in").mkdir()
    _refused(archive, tmp_path / "in", "too large")


def test_bad_objects_do_not_stop_a_build(tmp_path):
    scans, out = tmp_path / "scans", tmp_path / "out"
    _obj(scans, BOX.replace("v 0 0 0\n", "v nan 0 0\n", 1))
    (scans / "002_torn_google_16k.tgz").write_bytes(b"\x1f\x8b torn")
    results = {r.name: r for r in build("ycb", scans, out)}
    assert {r.status for r in results.values()} == {"failed"}
    assert "textured.obj" in results["001_thing"].reason
    assert "002_torn_google_16k.tgz" in results["002_torn"].reason
    assert not out.exists()


def test_unknown_names_offer_the_nearest(tmp_path):
    _obj(tmp_path / "scans", BOX)
    with pytest.raises(InputError, match="ycb"):
        build("ycbb", tmp_path, tmp_path / "out")
    with pytest.raises(InputError, match="did you mean 001_thing"):
        build("ycb", tmp_path / "scans", tmp_path / "out", only=["001_think"])
    with pytest.raises(InputError, match="no such file"):
        build("ycb", tmp_path / "nowhere", tmp_path / "out")


def test_out_that_is_a_file_is_refused(tmp_path):
    _obj(tmp_path / "scans", BOX)
    (tmp_path / "out").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        build("ycb", tmp_path / "scans", tmp_path / "out")
