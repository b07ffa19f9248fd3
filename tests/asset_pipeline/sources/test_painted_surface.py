"""Every place of an own mesh has the colour that its file gives it, however many materials that has."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from asset_pipeline.sources.files.images import as_rgb, why_unreadable
from asset_pipeline.sources.files.mesh_file import MeshFile, read_mesh_file

RED, GREEN, BLUE, YELLOW = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0)
# Corners of a square and where an image lies on it, by material: x is the number of the square.
SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


def _quarters(pixels: int = 64) -> Image.Image:
    """Red and green above, blue and yellow below."""
    image = np.zeros((pixels, pixels, 3), np.uint8)
    half = pixels // 2
    image[:half, :half], image[:half, half:] = RED, GREEN
    image[half:, :half], image[half:, half:] = BLUE, YELLOW
    return Image.fromarray(image)


def _squares(folder: Path, library: str, *materials: str, repeats: int = 1) -> Path:
    """One square after another along x, each with a material."""
    lines = ["mtllib m.mtl"]
    for i, material in enumerate(materials):
        lines += [f"v {x + 2 * i} {y} 0" for x, y in SQUARE]
        lines += [f"vt {x * repeats + 1} {y * repeats - 2}" for x, y in SQUARE]
        numbers = [4 * i + k for k in (1, 2, 3, 4)]
        lines += [f"usemtl {material}", "f " + " ".join(f"{n}/{n}" for n in numbers)]
    (folder / "m.mtl").write_text(library)
    (folder / "squares.obj").write_text("\n".join(lines))
    return folder / "squares.obj"


def _seen(found: MeshFile, place: tuple[float, float]) -> tuple[int, ...]:
    """The colour of the surface there."""
    mesh = found.mesh
    triangles = np.asarray(mesh.triangles)
    inside = trimesh.triangles.points_to_barycentric(
        triangles, np.tile([*place, 0.0], (len(triangles), 1))
    )
    face = int(np.flatnonzero((inside >= 0).all(axis=1))[0])
    assert found.image is not None
    u, v = inside[face] @ mesh.visual.uv[mesh.faces[face]]
    width, height = found.image.size
    pixel = found.image.getpixel((int(u % 1 * width), int((1 - v) % 1 * height)))
    assert isinstance(pixel, tuple)
    return pixel


def _near(seen: tuple[int, ...], colour: tuple[int, ...]) -> bool:
    return bool(np.abs(np.subtract(seen, colour)).max() < 25)


@pytest.mark.parametrize("pixels", [64, 4096])
def test_an_image_and_plain_colours_keep_their_places(tmp_path, pixels):
    _quarters(pixels).save(tmp_path / "print.png")
    library = "newmtl A\nKd 1 1 1\nmap_Kd print.png\nnewmtl B\nKd 1 0 0\nnewmtl C\nKd 0 0 1\n"
    found = read_mesh_file(_squares(tmp_path, library, "B", "A", "C"))
    assert found.image is not None and max(found.image.size) <= 1024
    # As small as a scene's picture of an object is.
    for shrunk in (found.image, found.image.resize((128, 128), Image.Resampling.BOX)):
        seen = MeshFile(found.mesh, shrunk, found.rgba, None, None)
        assert _near(_seen(seen, (0.5, 0.4)), RED) and _near(_seen(seen, (4.5, 0.4)), BLUE)
        for place, colour in (
            ((2.2, 0.8), RED), ((2.8, 0.8), GREEN), ((2.2, 0.2), BLUE), ((2.8, 0.2), YELLOW),
        ):  # fmt: skip
            assert _near(_seen(seen, place), colour), place


@pytest.mark.parametrize("materials", [("A",), ("A", "B")], ids=["alone", "beside a colour"])
def test_an_image_that_repeats_goes_on_repeating(tmp_path, materials):
    _quarters().save(tmp_path / "print.png")
    library = "newmtl A\nmap_Kd print.png\nnewmtl B\nKd 0 0 0\n"
    found = read_mesh_file(_squares(tmp_path, library, *materials, repeats=3))
    for column in range(3):
        for row in range(3):
            x, y = column / 3, row / 3
            assert _near(_seen(found, (x + 0.08, y + 0.25)), RED)
            assert _near(_seen(found, (x + 0.25, y + 0.08)), YELLOW)


def test_hundreds_of_images_have_their_places(tmp_path):
    colours = [(i % 17 * 15, i // 17 * 14, 90) for i in range(300)]
    library = []
    for i, colour in enumerate(colours):
        Image.new("RGB", (4, 4), colour).save(tmp_path / f"{i}.png")
        library.append(f"newmtl M{i}\nmap_Kd {i}.png")
    names = [f"M{i}" for i in range(len(colours))]
    found = read_mesh_file(_squares(tmp_path, "\n".join(library), *names))
    for i in range(0, len(colours), 13):
        assert _seen(found, (2 * i + 0.5, 0.4)) == colours[i]


def test_many_repeats_beside_a_colour_are_told(tmp_path, caplog):
    _quarters().save(tmp_path / "print.png")
    library = "newmtl A\nmap_Kd print.png\nnewmtl B\nKd 0 0 0\n"
    read_mesh_file(_squares(tmp_path, library, "A", "B", repeats=20))
    assert "an image repeats 20 times across a face; drawn as if 8 times" in caplog.text


@pytest.mark.parametrize(
    ("diffuse", "seen"), [("1 0 0", RED), ("0 0 0", YELLOW), ("0.6 0.6 0.6", YELLOW)]
)
def test_a_library_s_colour_tints_its_image_and_a_grey_does_not(tmp_path, diffuse, seen):
    Image.new("RGB", (8, 8), YELLOW).save(tmp_path / "print.png")
    path = _squares(tmp_path, f"newmtl A\nKd {diffuse}\nmap_Kd print.png\n", "A")
    assert _seen(read_mesh_file(path), (0.4, 0.5)) == seen


def _exported(path: Path, material: PBRMaterial | None, colours: np.ndarray | None = None) -> Path:
    box = trimesh.creation.box((0.06, 0.04, 0.12))
    if material is not None:
        box.visual = TextureVisuals(uv=np.zeros((len(box.vertices), 2)), material=material)
    if colours is not None:
        box.visual.vertex_attributes["color"] = colours
    box.export(path)
    return path


def test_a_factor_of_gltf_tints_its_image(tmp_path):
    yellow = Image.new("RGB", (8, 8), YELLOW)
    material = PBRMaterial(baseColorTexture=yellow, baseColorFactor=[0, 255, 255, 255])
    found = read_mesh_file(_exported(tmp_path / "box.glb", material))
    assert found.image is not None and found.image.getpixel((0, 0)) == GREEN


def test_a_material_of_gltf_without_a_factor_is_white_and_colours_of_vertices_count(tmp_path):
    assert read_mesh_file(_exported(tmp_path / "a.glb", PBRMaterial())).rgba == (1, 1, 1, 1)
    colours = np.tile(np.uint8([255, 0, 0, 255]), (8, 1))
    coloured = trimesh.creation.box((1, 1, 1))
    coloured.visual.vertex_colors = colours
    data = json.loads(trimesh.Scene(coloured).export(file_type="gltf")["model.gltf"])
    files = trimesh.Scene(coloured).export(file_type="gltf")
    data["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 1, 1]}}]
    data["meshes"][0]["primitives"][0]["material"] = 0
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "model.gltf").write_text(json.dumps(data))
    np.testing.assert_allclose(read_mesh_file(tmp_path / "model.gltf").rgba, (1, 0, 0, 1))


def test_an_image_stays_beside_colours_of_vertices(tmp_path):
    printed, painted = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((1, 1, 1))
    blue = PBRMaterial(baseColorTexture=Image.new("RGB", (8, 8), BLUE))
    printed.visual = TextureVisuals(uv=np.zeros((8, 2)), material=blue)
    painted.visual.vertex_colors = np.tile(np.uint8([255, 0, 0, 255]), (8, 1))
    painted.apply_translation([0, 0, 2])
    trimesh.Scene([printed, painted]).export(tmp_path / "two.glb")
    found = read_mesh_file(tmp_path / "two.glb")
    assert found.image is not None
    colours = set(map(tuple, np.asarray(found.image).reshape(-1, 3).tolist()))
    assert {RED, BLUE} <= colours


def test_coordinates_that_are_not_read_are_told(tmp_path, caplog):
    material = PBRMaterial(baseColorTexture=_quarters())
    path = _exported(tmp_path / "box.gltf", material)
    data = json.loads(path.read_text())
    placed = data["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
    for extra in (
        {},
        {"texCoord": 1},
        {"extensions": {"KHR_texture_transform": {"scale": [2, 2]}}},
    ):
        data["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = placed | extra
        path.write_text(json.dumps(data))
        caplog.clear()
        read_mesh_file(path)
        told = [record.getMessage() for record in caplog.records]
        assert len(told) == bool(extra) and all(
            "they will be out of place" in line for line in told
        )


def test_sixteen_bits_become_eight():
    image = Image.fromarray(np.array([[0, 32768, 65535]], np.uint16))
    assert np.asarray(as_rgb(image))[0, :, 0].tolist() == [0, 128, 255]
    dark = Image.fromarray(np.array([[0, 200]], np.uint16))
    assert np.asarray(as_rgb(dark))[0, :, 0].tolist() == [0, 1]
    few = Image.fromarray(np.array([[0, 255]], np.int32))
    assert np.asarray(as_rgb(few))[0, :, 0].tolist() == [0, 255]


def test_an_image_that_is_too_large_is_told_by_its_pixels(monkeypatch, tmp_path):
    Image.new("L", (3000, 2000)).save(tmp_path / "large.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1_000_000)
    with pytest.raises(Image.DecompressionBombError) as caught:
        Image.open(tmp_path / "large.png")
    assert why_unreadable(caught.value) == "6 megapixels; expected at most 2: make it smaller"
