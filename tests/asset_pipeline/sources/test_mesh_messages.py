"""What is left out of a folder of own meshes, and what is wrong with one, is said in one clear line."""

from __future__ import annotations

import json
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from asset_pipeline.build.data_set import build
from asset_pipeline.sources import meshes
from asset_pipeline.sources.categories import kind_of
from asset_pipeline.sources.files.mesh_file import read_mesh_file
from asset_pipeline.sources.meshes import MeshOptions
from asset_pipeline.sources.scan import load_scan_mesh
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError

SIZE = (0.2, 0.25, 0.3)  # too wide to grasp: quick
SAID = MeshOptions("box", "mirror", "z", "m", "CC0 1.0")


def _box(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box(SIZE).export(path)
    return path


def _names(path: Path) -> list[str]:
    return [item.name for item in meshes.items(path, SAID)]


def _refused(path: Path, options: MeshOptions) -> str:
    (item,) = meshes.items(path, options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError) as refused, meshes.opened(item):
            pass
    line = str(refused.value)
    assert line.startswith(f"{path}: ") and "\n" not in line
    return line.removeprefix(f"{path}: ")


def test_hidden_files_are_no_meshes(tmp_path, caplog):
    _box(tmp_path / "007.stl")
    _box(tmp_path / "more" / "mug.stl")
    for name in ("._007.stl", "__MACOSX/._007.stl", "__MACOSX/x.stl", ".trash/old.stl"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"\0\5\x16\7")
    assert _names(tmp_path) == ["007", "mug"] and caplog.records == []


def test_what_is_left_out_of_a_folder_is_counted(tmp_path, caplog):
    for name in ("mug.stl", "a/b/c/deep.stl", "a/b/deeper.obj", "a/b/.hidden.stl"):
        _box(tmp_path / name)
    (tmp_path / "gone.stl").symlink_to(tmp_path / "nowhere")
    assert _names(tmp_path) == ["mug"]
    broken, deep = [r.getMessage() for r in caplog.records]
    assert deep.startswith(f"{tmp_path}: left out 2 meshes, which lie more than one folder down")
    assert deep.endswith(f"{Path('a/b/deeper.obj')} and others")
    assert broken.endswith("left out 1 mesh, a link that leads nowhere: gone.stl")


def test_a_build_tells_what_is_left_out(tmp_path, caplog):
    _box(tmp_path / "in" / "tea_box.stl")
    _box(tmp_path / "in" / "a" / "b" / "deep.stl")
    build("meshes", tmp_path / "in", tmp_path / "out", said=SAID)
    assert "left out 1 mesh, which lies more than one folder down" in caplog.text


def test_a_link_is_named_for_its_own_folder(tmp_path):
    _box(tmp_path / "store" / "abc123" / "x.stl")
    (tmp_path / "mug").mkdir()
    (tmp_path / "mug" / "model.stl").symlink_to(tmp_path / "store" / "abc123" / "x.stl")
    assert _names(tmp_path / "mug" / "model.stl") == ["mug"]


@pytest.mark.parametrize(
    ("said", "category"),
    [("杯子", "杯子"), ("Café crème", "café_crème"), ("Toy  Car", "toy_car"), ("a__b", "a_b")],
)
def test_categories_may_be_of_any_script(said, category):
    assert kind_of(said).category == category
    assert MeshOptions(category=said).category == said


@pytest.mark.parametrize("category", ["", "  ", "!!!", "_"])
def test_a_category_without_a_letter_is_refused(category):
    with pytest.raises(InputError, match="has no letter or digit; expected a word such as mug"):
        MeshOptions(category=category)


def test_a_category_of_things_with_moving_parts_is_refused_at_once():
    with pytest.raises(InputError, match=r"--category Cabinet: has parts that move.* --type"):
        MeshOptions(category="Cabinet")
    assert MeshOptions(category="cabinet", object_type="mirror").object_type == "mirror"


def test_remarks_come_after_the_path_is_checked(tmp_path, caplog):
    with pytest.raises(InputError, match="no such file or folder"):
        build("meshes", tmp_path / "nowhere", tmp_path / "out")
    assert caplog.records == []


@pytest.mark.parametrize("ending", ["obj", "stl", "ply", "glb", "gltf", "dae", "off", "3mf"])
def test_an_empty_file_is_said_to_be_empty(tmp_path, ending):
    (tmp_path / f"mug.{ending}").touch()
    line = _refused(tmp_path / f"mug.{ending}", MeshOptions(category="mug"))
    assert line == "is empty; expected a mesh"


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("mug.glb", b"hello world, no mesh at all.....", "cannot be read as GLB; is it cut off"),
        ("mug.dae", b"<html><body>404</body></html>", "cannot be read as DAE; is it cut off"),
        ("mug.stl", trimesh.creation.box().export(file_type="stl")[:300], "is it cut off"),
        ("mug.glb", trimesh.creation.box().export(file_type="glb")[:300], "is it cut off"),
    ],
)
def test_what_is_no_mesh_is_said_without_a_library_s_words(tmp_path, name, content, told):
    (tmp_path / name).write_bytes(content)
    line = _refused(tmp_path / name, MeshOptions(category="mug"))
    assert told in line and "Error" not in line and "(" not in line


def test_a_buffer_that_is_not_there_is_named(tmp_path):
    for name, data in trimesh.creation.box(SIZE).export(file_type="gltf").items():
        if name.endswith(".gltf"):
            (tmp_path / "mug.gltf").write_bytes(data)
    line = _refused(tmp_path / "mug.gltf", MeshOptions(category="mug"))
    assert line == "names gltf_buffer_0.bin, which is not there; expected it beside the mesh"


def test_a_compressed_mesh_is_refused(tmp_path):
    data = trimesh.creation.box(SIZE).export(file_type="glb")
    length = struct.unpack("<I", data[12:16])[0]
    tree = json.loads(data[20 : 20 + length])
    tree["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    (tmp_path / "mug.glb").write_bytes(head + text + rest)
    line = _refused(tmp_path / "mug.glb", MeshOptions(category="mug"))
    assert line == "is compressed by Draco, which is not read; export it without compression"


@pytest.mark.parametrize("unit", [None, "m"])
@pytest.mark.parametrize("ending", ["stl", "ply"])
def test_a_vertex_that_is_no_number_is_told_and_nothing_else(tmp_path, ending, unit):
    box = trimesh.creation.box(SIZE)
    vertices = np.array(box.vertices)
    vertices[3] = np.nan
    trimesh.Trimesh(vertices, box.faces, process=False).export(tmp_path / f"mug.{ending}")
    line = _refused(tmp_path / f"mug.{ending}", MeshOptions(category="mug", unit=unit))
    assert "vertices are NaN or infinite" in line


def test_a_mesh_of_no_size_is_told_and_nothing_else(tmp_path):
    (tmp_path / "mug.obj").write_text("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n")
    assert "zero size" in _refused(tmp_path / "mug.obj", MeshOptions(category="mug"))


def test_a_first_vertex_behind_a_byte_order_mark_counts_in_data_sets_too(tmp_path):
    text = trimesh.exchange.obj.export_obj(trimesh.creation.box(SIZE), header=None)
    (tmp_path / "a.obj").write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert len(load_scan_mesh(tmp_path / "a.obj").vertices) == 8


def test_a_collada_file_without_a_unit_states_none(tmp_path):
    pytest.importorskip("collada")
    path = _box(tmp_path / "mug.dae")
    assert read_mesh_file(path).unit is None
    text = path.read_text().replace("<up_axis>", '<unit name="inch" meter="0.0254"/><up_axis>')
    path.write_text(text)
    assert read_mesh_file(path).unit == 0.0254


def _vessel(path: Path) -> None:
    body = trimesh.creation.cylinder(0.1, 0.2, sections=32)
    handle = trimesh.creation.box((0.06, 0.02, 0.12))
    handle.apply_translation([0.12, 0, 0])
    trimesh.boolean.union([body, handle]).export(path)


def test_a_type_that_does_not_fit_is_told(tmp_path, caplog):
    _vessel(tmp_path / "jug.stl")
    said = MeshOptions("jug", "axial", "z", "m", "CC0 1.0")
    (result,) = build("meshes", tmp_path / "jug.stl", tmp_path / "out", said=said)
    assert result.status == "built", result.reason
    assert read_asset(result.folder).label.object_type == "mirror"
    (told,) = [w for w in result.warnings if "--type" in w]
    assert told.endswith(
        "--type axial does not fit what sticks out at its side; labelled as mirror"
    )


@pytest.mark.parametrize(
    ("name", "category", "object_type", "by"),
    [
        ("tin", "tin", "axial", "--type axial"),
        ("thin_plate", None, None, "category plate by its name"),
    ],
)
def test_an_axis_that_is_not_found_is_told_and_leaves_no_confidence(
    name, category, object_type, by, tmp_path
):
    _box(tmp_path / f"{name}.stl")
    said = MeshOptions(category, object_type, "z", "m", "CC0 1.0")
    (result,) = build("meshes", tmp_path / f"{name}.stl", tmp_path / "out", said=said)
    assert result.status == "built", result.reason
    asset = read_asset(result.folder)
    assert asset.label.object_type == "axial" and not asset.label.symmetry.axial
    assert asset.label_quality is not None and asset.label_quality.confidence < 0.1
    (told,) = [w for w in result.warnings if "--type" in w]
    expected = f"{by}: no axis of revolution was found; labelled by planes: say --type mirror"
    assert told.endswith(expected)


@pytest.mark.full
def test_an_asset_of_a_category_in_another_script_is_drawn(tmp_path, capsys):
    _box(tmp_path / "tea.stl")
    command = ["assets", "build", "meshes", str(tmp_path / "tea.stl"), "--out", str(tmp_path / "a")]
    command += ["--category", "杯子", "--up", "z", "--unit", "m", "--type", "mirror"]
    assert main(command) == 0
    assert main(["assets", "sheet", str(tmp_path / "a"), "--out", str(tmp_path / "s")]) == 0
    assert read_asset(tmp_path / "a" / "tea").category == "杯子"


def test_an_object_far_from_its_origin_is_moved_there_but_for_its_height(tmp_path, caplog):
    box = trimesh.creation.box(SIZE)
    box.apply_translation((40, -3, 0.2))
    box.export(tmp_path / "tea_box.stl")
    (item,) = meshes.items(tmp_path, SAID)
    with meshes.opened(item) as scan:
        middle = scan.mesh.bounds.mean(axis=0)
    np.testing.assert_allclose(middle, (0, 0, 0.2), atol=1e-5)
    assert "the origin is far from the object; moved it by -40 3 0 m" in caplog.text


@pytest.mark.parametrize(
    ("written", "instead"),
    [(b" ", b"\t"), (b"\n", b"\r"), (b"\n", b"\r\n"), (b" 0", b" \\\n0")],
    ids=["tabs", "old lines of macOS", "lines of Windows", "lines that go on"],
)
def test_obj_files_are_read_however_their_lines_are_written(tmp_path, written, instead, caplog):
    path = tmp_path / "box.obj"
    trimesh.creation.box(SIZE).export(path)
    path.write_bytes(path.read_bytes().replace(written, instead))
    np.testing.assert_allclose(read_mesh_file(path).mesh.extents, SIZE, atol=1e-6)
    assert caplog.records == []


def test_a_folder_that_links_to_itself_is_read_once(tmp_path):
    _box(tmp_path / "mug.stl")
    (tmp_path / "self").symlink_to(tmp_path)
    assert _names(tmp_path) == ["mug"]
