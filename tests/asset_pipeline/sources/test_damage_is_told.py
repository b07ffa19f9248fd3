"""Damage that a lenient reader passes over in silence is refused or told, and published files are quiet."""

from __future__ import annotations

import logging
import re
import tarfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.exchange.ply import export_ply

from asset_pipeline.build.data_set import SOURCES
from asset_pipeline.geometry.repair import drop_flaps, spikes
from asset_pipeline.sources.files.ply_rows import check_rows
from asset_pipeline.sources.files.references import leaves
from asset_pipeline.sources.files.surface_defects import face_defects
from asset_pipeline.sources.scan import write_texture
from manipose_mj.errors import InputError
from tests.asset_pipeline.sources.damaged_files import Case
from tests.asset_pipeline.sources.valid_files import FINE, scanned_box, valid
from tests.places import REAL_DATA

COARSE = 2


def sub(pattern: str, text: str) -> Callable[[bytes], bytes]:
    """Replace the first match, which must be there."""

    def edit(data: bytes) -> bytes:
        changed, count = re.subn(pattern.encode(), text.encode(), data, count=1)
        assert count == 1
        return changed

    return edit


def scaled(factor: float) -> Callable[[bytes], bytes]:
    """All vertices of an OBJ times a factor."""

    def vertex(match: re.Match[bytes]) -> bytes:
        return b"v " + " ".join(f"{factor * float(v):.9g}" for v in match[1].split()).encode()

    return lambda data: re.sub(rb"(?m)^v (.*)$", vertex, data)


def turned(data: bytes) -> bytes:
    """All faces of an OBJ the other way round."""
    return re.sub(rb"(?m)^f (\S+) (\S+) (\S+)$", rb"f \3 \2 \1", data)


# What was done: the source, the file, the damage, and a part of what is said of it.
DAMAGE: dict[str, tuple[str, str, Callable[[bytes], bytes], str]] = {
    "keyword": ("omniobject3d", "obj$", sub("mtllib", "mullib"), "'mullib' is no keyword"),
    "corner missing": ("ycb", "obj$", lambda d: d + b"f 1\n", "at least 3 corners"),
    "corner of another form": ("google_scanned_objects", "obj$", sub(r"f (\d+)/\d+", r"f \1"), "unlike"),
    "relative index": ("partnet_mobility", "0.obj$", sub(r"f 2/", "f -7/"), "unlike each other"),
    "texture index": ("ycb", "obj$", sub(r"f (\d+)/\d+", r"f \1/9999"), "texture coordinate 9999"),
    "faces cut off": ("google_scanned_objects", "obj$", lambda d: d[: d.rindex(b"\nf")], "open edges"),
    "newline cut off": ("ycb", "obj$", lambda d: d[:-1], "newline"),
    "count": ("ycb", "obj$", lambda d: d[: d.rindex(b"\nf") + 1], "its header says 192 faces, it has 191"),
    "vertex unused": ("omniobject3d", "obj$", sub("\nvt", "\nv 1 1 1\nvt"), "belong to no face"),
    "control character": ("omniobject3d", "obj$", sub("usemtl mat", "usemtl m\x01t"), "control characters"),
    "library outside": ("ycb", "obj$", sub("textured.mtl", "../../textured.mtl"), "outside its folder"),
    "image outside": ("ycb", "mtl$", sub("texture_map.png", "/x/texture_map.png"), "outside the object's"),
    "image of a PLY outside": ("pace", "ply$", sub("File obj", "File ../obj"), "outside its folder"),
    "number missing": ("pace", "ply$", sub(r"\n-?\d+\.0+ ", "\n"), "vertex 0 has not the numbers"),
    "colour too large": ("pace", "ply$", sub("255 255 255 255", "255 255 275 255"), "face 0 has not"),
    "header": ("pace", "ply$", sub("property float texture_v", "propesty float texture_v"), "header cannot"),
    "size not stated": ("pace", "json$", sub("size_x", "size_w"), "states no size"),
    "flat": ("ycb", "obj$", lambda d: re.sub(rb"(?m)^v \S+", b"v 0", d), "flat"),
    "needle": ("google_scanned_objects", "obj$", sub(r"v -0.055000", "v -0.955000"), "1 vertex sticks out"),
    "unit": ("partnet_mobility", "[01].obj$", scaled(0.0254), "another unit"),
    "garbage": ("partnet_mobility", "[01].obj$", scaled(1e20), "a coordinate is 5e+19"),
    "gigantic": ("partnet_mobility", "[01].obj$", scaled(1e5), "expected about 2"),
    "part moved": ("partnet_mobility", "1.obj$", scaled(1.01), "bounding_box.json"),
    "part inside out": ("partnet_mobility", "0.obj$", turned, "12 of 12 faces pointed inwards"),
    "part torn": ("partnet_mobility", "0.obj$", lambda d: d[: d.rindex(b"\nf") + 1], "small hole"),
    "part bent": ("partnet_mobility", "0.obj$", sub("v -0.5", "v 0.1"), "tilted from their stated normals"),
    "part pressed flat": ("partnet_mobility", "1.obj$", sub("(?s)0.55.*0.55", "0.50"), "cannot be read"),
    "material": ("partnet_mobility", "mtl$", sub("newmtl material_0", "newmtl material_1"), "'material_0' is"),
    "library": ("partnet_mobility", "mtl$", lambda _: b"", "defines no material"),
    "category": ("partnet_mobility", "meta.json$", lambda _: b"[0]", "does not say the category"),
    "semantics": ("partnet_mobility", "semantics", sub("link_1", "link_7"), "'link_7', which is no link"),
    "motion": ("partnet_mobility", "semantics", sub("hinge", "slider"), "its joint is revolute"),
    "axis": ("partnet_mobility", "urdf$", sub('xyz="0.5 0 0.5"', 'xyz="0.3 0 0.5"'), "axis of link 'link_1'"),
    "origin": ("partnet_mobility", "urdf$", sub('"-0.5 0 -0.5"', '"-0.2 0 -0.5"'), "not where it was drawn"),
    "limit": ("partnet_mobility", "urdf$", sub('"1.5707963"/></j', '"1.1707963"/></j'), "moves by"),
    "part's name": ("partnet_mobility", "urdf$", sub("body-0", "bodi-0"), "the same parts of link"),
    "record": ("partnet_mobility", "v2.json$", lambda _: b"[]", "no entry for 2 of 2 links"),
}  # fmt: skip


def read(case: Case, folder: Path, caplog: pytest.LogCaptureFixture) -> str:
    """All that is said when the object is read: warnings and error."""
    module = SOURCES[case.source]
    with caplog.at_level(logging.WARNING):
        try:
            (item,) = module.items(case.write(folder))
            with module.opened(item):
                pass
        except InputError as error:
            return f"{caplog.text} {error}"
    return caplog.text


@pytest.mark.parametrize("what", DAMAGE)
def test_damage_is_told(what, tmp_path, caplog):
    source, file, edit, message = DAMAGE[what]
    content = valid(source, COARSE)
    changed = {n: edit(d) if re.search(file, n) else d for n, d in content.items()}
    assert changed != content
    said = read(Case(source, what, changed, ""), tmp_path, caplog)
    assert message in said, said


def test_archive_without_its_last_bytes_is_refused(tmp_path, caplog):
    case = Case("omniobject3d", "", valid("omniobject3d", COARSE), ".tgz")
    path = case.write(tmp_path)
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(InputError, match="truncated"):
        SOURCES["omniobject3d"].items(path)


def test_image_whose_checksum_is_wrong_is_refused(tmp_path):
    image = bytearray(valid("ycb", COARSE)["001_thing/google_16k/texture_map.png"])
    image[-18] ^= 1  # in the checksum of the pixels
    (tmp_path / "a.png").write_bytes(image)
    with pytest.raises(InputError, match="cannot be read as an image"):
        write_texture(tmp_path / "a.png", tmp_path / "b.png")


@pytest.mark.parametrize("more", [-1, 1])
@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_ply_of_another_length_than_announced_is_refused(more, encoding, tmp_path):
    path = tmp_path / "a.ply"
    data = export_ply(trimesh.creation.box(), encoding=encoding.split("_")[0])
    path.write_bytes(data)
    check_rows(path)
    path.write_bytes(data[:-2] if more < 0 else data + b"\n1 2 3")
    with pytest.raises(InputError, match="announces|has not the numbers"):
        check_rows(path)


@pytest.mark.parametrize(
    ("name", "depth", "outside"),
    [
        ("material.mtl", 0, False),
        ("sub/../x.png", 0, False),
        ("../images/x.png", 1, False),
        ("..\\images\\x.png", 0, True),
        ("a/../../x", 0, True),
        ("/etc/passwd", 0, True),
        ("C:\\x.png", 0, True),
        ("file:///etc/passwd", 0, True),
        ("~/x", 0, True),
        ("a\0b", 0, True),
    ],
)
def test_references_that_leave_the_folder(name, depth, outside):
    assert leaves(name, depth=depth) == outside


def test_both_sides_of_a_sheet_are_right_and_a_missing_one_is_told():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    sheet = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]])
    nothing = np.full((4, 3, 3), np.nan)
    turned, defects = face_defects(points, sheet, nothing)
    assert not turned.any() and defects == []
    _, defects = face_defects(points, sheet[:3], nothing[:3])
    assert defects == ["1 of 3 faces lack the reverse that the others have"]
    down = np.broadcast_to([0.0, 0.0, -1.0], (4, 3, 3))
    _, defects = face_defects(points, sheet, down)
    assert defects == ["2 of 4 faces point against their stated normals"]


def test_face_across_the_object_is_left_out_and_short_ones_at_a_rim_are_not():
    mesh = scanned_box(FINE)
    assert drop_flaps(mesh) == 0
    faces = np.array(mesh.faces)
    faces[0, 0] = np.linalg.norm(mesh.vertices - mesh.vertices[faces[0, 1]], axis=1).argmax()
    torn = trimesh.Trimesh(mesh.vertices, faces, process=False)
    assert drop_flaps(torn) == 1 and len(torn.faces) == len(faces) - 1
    rim = mesh.submesh([np.flatnonzero(mesh.triangles_center[:, 2] < 0.055)], append=True)
    assert isinstance(rim, trimesh.Trimesh) and drop_flaps(rim) == 0


def test_sharp_corners_are_no_needles():
    cone = trimesh.creation.cone(0.01, 0.1, sections=8)
    assert spikes(trimesh.creation.box()) == 0
    assert spikes(trimesh.creation.icosphere()) == 0
    assert spikes(cone.subdivide().subdivide()) == 0


@pytest.mark.parametrize(("sections", "squeeze"), [(8, 1.0), (32, 1.0), (32, 0.5)])
def test_the_tip_of_a_plain_cone_is_no_needle(sections, squeeze):
    cone = trimesh.creation.cone(0.035, 0.09, sections=sections)
    assert spikes(cone.apply_scale([1, squeeze, 1])) == 0


def test_a_vertex_that_is_moved_far_off_is_a_needle():
    mesh = trimesh.creation.icosphere(3, 0.05)
    mesh.vertices[100, 0] += 0.1
    assert spikes(mesh) == 1


def test_the_middle_of_a_fan_is_no_needle():
    profile = np.array(
        [[0, 0], [0.03, 0.004], [0.05, 0.03], [0.048, 0.03], [0.029, 0.006], [0, 0.002]]
    )
    assert spikes(trimesh.creation.revolve(profile, sections=64)) == 0


REAL = {
    "ycb": ("ycb/030_fork_google_16k.tgz", None),
    "google_scanned_objects": ("google_scanned_objects.tar.xz", "Room_Essentials_Salad_Plate_Turquoise"),
    "partnet_mobility": ("partnet_mobility.tar.xz", "7167"),
}  # fmt: skip


@pytest.mark.parametrize("source", REAL)
def test_published_objects_are_read_without_a_warning(source, tmp_path, caplog):
    path, name = REAL_DATA / REAL[source][0], REAL[source][1]
    if not path.is_file():
        pytest.skip(f"no {path}; set MANIPOSE_REAL_DATA to a folder with it")
    if name is not None:  # one object of many
        with tarfile.open(path) as archive:
            requested = [m for m in archive if f"/{name}/" in m.name]
            archive.extractall(tmp_path, requested, filter="data")
        path = tmp_path
    module = SOURCES[source]
    with caplog.at_level(logging.WARNING):
        (item,) = module.items(path)
        with module.opened(item):
            pass
    assert not caplog.records
