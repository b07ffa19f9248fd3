"""The texture of an own mesh is the image that its library means; what is not there is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from asset_pipeline.sources.files.mesh_file import MeshFile, read_mesh_file
from asset_pipeline.sources.files.near_files import companions
from manipose_mj.errors import InputError

RED, GREEN = (255, 0, 0), (0, 255, 0)


def _obj(folder: Path, library: str, materials: tuple[str, ...] = ("A",)) -> Path:
    """A box with coordinates of a texture; each material has some of its faces."""
    folder.mkdir(parents=True, exist_ok=True)
    box = trimesh.creation.box((0.06, 0.04, 0.12))
    lines = ["mtllib m.mtl", *("v {} {} {}".format(*v) for v in box.vertices)]
    lines += ["vt 0.1 0.1", "vt 0.9 0.1", "vt 0.5 0.9"]
    for k, (a, b, c) in enumerate(box.faces + 1):
        if k % 6 == 0:
            lines.append(f"usemtl {materials[k // 6 % len(materials)]}")
        lines.append(f"f {a}/1 {b}/2 {c}/3")
    (folder / "box.obj").write_text("\n".join(lines) + "\n")
    (folder / "m.mtl").write_text(library)
    return folder / "box.obj"


def _image(path: Path, colour: tuple[int, int, int] = RED, size: int = 16) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (size, size), colour).save(path)


def _colour(found: MeshFile) -> tuple[int, ...] | None:
    if found.image is None:
        return None
    pixel = found.image.convert("RGB").getpixel((0, 0))
    assert isinstance(pixel, tuple)
    return pixel


@pytest.mark.parametrize(
    ("named", "file"),
    [
        ("textures/print.png", "textures/print.png"),
        ("textures\\print.png", "textures/print.png"),
        ("C:\\Users\\me\\print.png", "print.png"),
        ("/home/me/textures/print.png", "textures/print.png"),
        ("Print.PNG", "print.png"),
        ("-s 1 1 1 -clamp on my print.png", "my print.png"),
        ("my%20print.png", "my print.png"),
    ],
)
def test_the_image_is_found_however_the_name_is_spelt(tmp_path, named, file, caplog):
    path = _obj(tmp_path, f"newmtl A\nKd 1 1 1\nmap_Kd {named}\n")
    _image(tmp_path / file)
    _image(tmp_path / "other.png", GREEN)
    assert _colour(read_mesh_file(path)) == RED and caplog.records == []
    assert tmp_path / file in companions(path)


@pytest.mark.parametrize(
    ("library", "told"),
    [
        ("map_Kd gone.png", "names gone.png, which is not there; built without"),
        (
            "map_Kd gone.png\nnewmtl B\nmap_Kd lost.jpg",
            "names gone.png, lost.jpg, which are not there; built without",
        ),
        (
            "map_Kd ../tex/print.png",
            "names ../tex/print.png, outside its folder, which is not opened; built without",
        ),
    ],
)
def test_an_image_that_is_not_there_is_told_in_one_line(tmp_path, library, told, caplog):
    path = _obj(tmp_path / "in", f"newmtl A\n{library}\n")
    _image(tmp_path / "tex" / "print.png")
    assert read_mesh_file(path).image is None
    assert [r.getMessage() for r in caplog.records] == [f"{path}: {told}"]


def test_what_takes_the_place_of_a_missing_image_is_told(tmp_path, caplog):
    path = _obj(tmp_path, "newmtl A\nmap_Kd gone.png\n")
    _image(tmp_path / "box.png")
    assert _colour(read_mesh_file(path)) == RED
    (told,) = [r.getMessage() for r in caplog.records]
    assert told == f"{path}: names gone.png, which is not there; built with box.png"


def test_a_library_that_is_not_there_is_told(tmp_path, caplog):
    path = _obj(tmp_path, "")
    (tmp_path / "m.mtl").unlink()
    read_mesh_file(path)
    (told,) = [r.getMessage() for r in caplog.records]
    assert told == f"{path}: names m.mtl, which is not there; built without"


def test_one_image_of_two_that_is_not_there_is_told(tmp_path, caplog):
    path = _obj(tmp_path, "newmtl A\nmap_Kd a.png\nnewmtl B\nmap_Kd gone.png\n", ("A", "B"))
    _image(tmp_path / "a.png")
    assert read_mesh_file(path).image is not None
    (told,) = [r.getMessage() for r in caplog.records]
    assert "names gone.png, which is not there" in told


def test_an_image_that_cannot_be_read_is_refused_by_name(tmp_path):
    path = _obj(tmp_path, "newmtl A\nmap_Kd print.png\n")
    (tmp_path / "print.png").write_bytes(b"\x89PNG\r\n\x1a\nno more")
    _image(tmp_path / "other.png", GREEN)
    with pytest.raises(InputError, match=r"print\.png: cannot be read as an image"):
        read_mesh_file(path)


@pytest.mark.parametrize("size", [1, 2])
def test_a_palette_of_few_pixels_is_a_texture(tmp_path, size):
    path = _obj(tmp_path, "newmtl A\nmap_Kd palette.png\n")
    _image(tmp_path / "palette.png", RED, size)
    _image(tmp_path / "normal.png", (128, 128, 255))
    found = read_mesh_file(path)
    assert _colour(found) == RED and found.image is not None and found.image.size == (size, size)


@pytest.mark.parametrize("keyword", ["map_Bump", "bump", "norm", "map_Ks", "map_bump -bm 1.0"])
def test_a_map_of_something_else_is_no_colour(tmp_path, keyword, caplog):
    path = _obj(tmp_path, f"newmtl A\nKd 0 1 0\n{keyword} normal.png\n")
    _image(tmp_path / "normal.png", (128, 128, 255))
    found = read_mesh_file(path)
    assert found.image is None and found.rgba == (0, 1, 0, 1) and caplog.records == []
    # Beside it, the only other image is the colour, and decides with it whether the asset is up to date.
    _image(tmp_path / "print.png")
    assert _colour(read_mesh_file(path)) == RED
    assert {f.name for f in companions(path)} == {"m.mtl", "normal.png", "print.png"}


def test_the_same_image_may_be_colour_and_something_else(tmp_path):
    path = _obj(tmp_path, "newmtl A\nmap_Ks print.png\nmap_Kd print.png\n")
    _image(tmp_path / "print.png")
    assert _colour(read_mesh_file(path)) == RED


def test_hidden_files_are_no_images(tmp_path):
    path = _obj(tmp_path, "newmtl A\nKd 1 1 1\n")
    _image(tmp_path / "print.png")
    (tmp_path / "._print.png").write_bytes(b"\0\5\x16\7")
    assert _colour(read_mesh_file(path)) == RED
    assert [f.name for f in companions(path)] == ["m.mtl", "print.png"]


@pytest.mark.parametrize("comment", ["", "# from an editor\n"])
def test_a_byte_order_mark_hides_nothing(tmp_path, comment, caplog):
    path = _obj(tmp_path, "newmtl A\nmap_Kd print.png\n")
    text = path.read_text().replace("mtllib m.mtl\n", "") if comment else path.read_text()
    path.write_bytes(b"\xef\xbb\xbf" + comment.encode() + text.encode())
    library = tmp_path / "m.mtl"
    library.write_bytes(b"\xef\xbb\xbf" + library.read_bytes())
    _image(tmp_path / "print.png")
    _image(tmp_path / "other.png", GREEN)
    found = read_mesh_file(path)
    assert len(found.mesh.faces) == 12 and caplog.records == []
    assert _colour(found) == (None if comment else RED)


def test_a_first_vertex_behind_a_byte_order_mark_is_read(tmp_path):
    box = trimesh.creation.box((0.06, 0.04, 0.12))
    path = tmp_path / "box.obj"
    path.write_bytes(b"\xef\xbb\xbf" + trimesh.exchange.obj.export_obj(box, header=None).encode())
    np.testing.assert_allclose(read_mesh_file(path).mesh.extents, [0.06, 0.04, 0.12])


@pytest.mark.parametrize(("mode", "alpha", "opacity"), [("BLEND", 0, 0.15), ("OPAQUE", 0, 1.0)])
def test_no_material_is_invisible(tmp_path, mode, alpha, opacity):
    box = trimesh.creation.box((0.06, 0.04, 0.12))
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[0, 255, 0, alpha], alphaMode=mode
    )
    box.visual = trimesh.visual.TextureVisuals(material=material)
    box.export(tmp_path / "box.glb")
    assert read_mesh_file(tmp_path / "box.glb").rgba == (0, 1, 0, opacity)
