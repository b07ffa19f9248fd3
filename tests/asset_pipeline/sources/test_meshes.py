"""Own meshes: every format, what is said and what is guessed of them, and bad files among good ones."""

from __future__ import annotations

import contextlib
import json
import tarfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from asset_pipeline.build.data_set import build
from asset_pipeline.sources import meshes
from asset_pipeline.sources.categories import kind_of_file
from asset_pipeline.sources.mesh_guesses import AXES, UNITS, guess_unit, guess_up
from asset_pipeline.sources.meshes import MeshOptions
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from tests.places import REAL_DATA

SCANS = REAL_DATA / "gso_more.tar.xz"
SIZE = np.array([0.06, 0.04, 0.12])
SAID = MeshOptions(category="box", up="z", unit="mm", licence="CC0 1.0")


def _box(*, textured: bool = False, unit: float = 0.001) -> trimesh.Trimesh:
    box = trimesh.creation.box(SIZE / unit)
    if textured:
        uv = np.asarray(box.vertices)[:, :2] * unit * 4 + 0.5
        box.visual = trimesh.visual.TextureVisuals(uv=uv, image=_picture())
    return box


def _picture() -> Image.Image:
    pixels = np.random.default_rng(0).integers(0, 255, (16, 16, 3), dtype=np.uint8)
    return Image.fromarray(pixels)


def _read(path: Path, options: MeshOptions = SAID):
    (item,) = meshes.items(path, options)
    with meshes.opened(item) as scan:
        return scan, None if scan.texture is None else Image.open(scan.texture).size


@pytest.mark.parametrize("ending", ["obj", "stl", "ply", "glb", "gltf", "off", "dae"])
def test_every_format_is_read_in_metres_as_said(tmp_path, ending, caplog):
    if ending == "dae":
        pytest.importorskip("collada")
    _box().export(tmp_path / f"tea box.{ending}")
    path = tmp_path if ending == "gltf" else tmp_path / f"tea box.{ending}"
    scan, _ = _read(path)
    assert (scan.name, scan.category, scan.object_type) == ("tea_box", "box", "mirror")
    np.testing.assert_allclose(scan.mesh.extents, SIZE, atol=1e-6)
    assert scan.mesh.is_watertight
    np.testing.assert_array_equal(scan.up, [0, 0, 1])
    provenance = scan.provenance
    assert (provenance.source, provenance.item) == ("own mesh", f"tea box.{ending}")
    assert provenance.licence == "CC0 1.0" and caplog.records == []


@pytest.mark.parametrize("ending", ["obj", "glb"])
def test_textures_of_materials_are_found(tmp_path, ending):
    _box(textured=True).export(tmp_path / f"tea.{ending}")
    scan, pixels = _read(tmp_path / f"tea.{ending}")
    assert pixels is not None and scan.mesh.visual.uv.shape == (len(scan.mesh.vertices), 2)


@pytest.mark.parametrize("image", ["tea.png", "tea.jpg", "print.jpeg"])
def test_an_image_that_no_material_names_is_found_beside_the_mesh(tmp_path, image):
    text = trimesh.exchange.obj.export_obj(_box(textured=True), include_texture=False)
    uv = "\n".join(f"vt {x:.3f} {y:.3f}" for x, y in _box(textured=True).visual.uv)
    faces = "\n".join("f " + " ".join(f"{i}/{i}" for i in f + 1) for f in _box().faces)
    vertices = "\n".join(line for line in text.splitlines() if line.startswith("v "))
    (tmp_path / "tea.obj").write_text(f"{vertices}\n{uv}\n{faces}\n")
    _picture().save(tmp_path / image)
    scan, pixels = _read(tmp_path / "tea.obj")
    assert pixels == (16, 16) and set(scan.provenance.inputs) == {"tea.obj", image, meshes.SAID}


@pytest.mark.parametrize("named", ["../private.png", "{folder}/private.png"])
def test_an_image_outside_the_folder_is_not_opened(tmp_path, named):
    _picture().save(tmp_path / "private.png")
    (tmp_path / "in").mkdir()
    _box(textured=True).export(tmp_path / "in" / "tea.obj")
    library = tmp_path / "in" / "material.mtl"
    image = named.format(folder=tmp_path)
    library.write_text(library.read_text().replace("material_0.png", image))
    (tmp_path / "in" / "material_0.png").unlink()
    scan, pixels = _read(tmp_path / "in" / "tea.obj")
    assert pixels is None and "private.png" not in str(scan.provenance.inputs)


def test_several_materials_become_one_image_and_a_plain_colour_stays(tmp_path):
    green = trimesh.creation.box(SIZE)
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[0, 255, 0, 255])
    green.visual = trimesh.visual.TextureVisuals(material=material)
    green.export(tmp_path / "green.glb")
    scan, pixels = _read(tmp_path / "green.glb", MeshOptions("box", up="z", unit="m"))
    assert pixels is None and scan.rgba == (0, 1, 0, 1)
    green.apply_translation([0, 0, SIZE[2]])
    trimesh.Scene([_box(textured=True, unit=1.0), green]).export(tmp_path / "two.glb")
    scan, pixels = _read(tmp_path / "two.glb", MeshOptions("box", up="z", unit="m"))
    assert pixels is not None
    np.testing.assert_allclose(scan.mesh.extents, SIZE * [1, 1, 2], atol=1e-6)


def test_what_is_not_said_is_guessed_in_one_warning(tmp_path, caplog):
    bottle = trimesh.creation.cylinder(3.5, 22.0)  # centimetres
    bottle.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], [0, 1, 0]))
    bottle.export(tmp_path / "green_bottle.ply")
    scan, _ = _read(tmp_path / "green_bottle.ply", MeshOptions())
    assert (scan.category, scan.object_type) == ("bottle", "axial")
    np.testing.assert_allclose(scan.mesh.extents, [0.07, 0.22, 0.07], atol=1e-3)
    np.testing.assert_array_equal(scan.up, [0, 1, 0])
    assert scan.provenance.licence == "unknown"
    (told,) = [r.getMessage() for r in caplog.records]
    for phrase in ("green_bottle.ply: not stated", "bottle by its name", "unit cm", "y up"):
        assert phrase in told


@pytest.mark.parametrize(
    ("longest", "category", "unit"),
    [(0.1, "mug", "m"), (10, "mug", "cm"), (100, "mug", "mm"), (12, "hammer", "in"),
     (300, "hammer", "mm"), (0.3, "hammer", "m"), (150, "gadget", "mm"), (0.15, "gadget", "m")],
)  # fmt: skip
def test_the_unit_is_the_one_that_suits_the_category(longest, category, unit):
    assert guess_unit(longest, category) == unit


@pytest.mark.full
@pytest.mark.skipif(not SCANS.is_file(), reason=f"{SCANS} is not there")
def test_guesses_are_right_for_nearly_all_real_scans(tmp_path):
    with tarfile.open(SCANS) as archive:
        archive.extractall(tmp_path, filter="data")
    ups, units = [], []
    for file in sorted(tmp_path.glob("**/model.obj")):
        mesh = trimesh.load(file, force="mesh", process=False, skip_materials=True)
        kind = kind_of_file(file.parent.name)
        ups.append(guess_up(mesh, kind.object_type) == "z")
        mesh.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], [0, 1, 0]))
        ups.append(guess_up(mesh, kind.object_type) == "y")
        for unit in ("m", "mm"):
            longest = float(mesh.extents.max()) / UNITS[unit]
            with contextlib.suppress(InputError):  # it asks: that is no wrong guess
                units.append(guess_unit(longest, kind.category) == unit)
    assert len(ups) > 200 and np.mean(ups) > 0.97 and np.mean(units) > 0.99


@pytest.mark.parametrize(
    ("name", "category"),
    [
        ("mug2", "mug"),
        ("mug.final", "mug"),
        ("TeaSpoon_silver", "spoon"),
        ("wine_glass", "wine_glass"),
        ("power_drill_v3", "drill"),
        ("green_bottles", "bottle"),
        ("can_opener", "can_opener"),
        ("toothbrushes", "toothbrush"),
        ("oven", "household_item"),
        ("thing_007", "household_item"),
        ("Tea_spoon_with_a_long_description_of_a_box", "box"),
    ],
)
def test_the_last_word_that_is_known_tells_the_category(name, category):
    assert kind_of_file(name).category == category


def test_every_rigid_category_is_known_by_its_own_name():
    for name, category in CATALOGUE.items():
        found = kind_of_file(f"my_{name}_01")
        if category.object_type != "articulated":
            assert (found.category, found.object_type) == (name, category.object_type)


def test_a_size_that_suits_in_no_unit_asks_for_the_unit(tmp_path):
    trimesh.creation.box((1, 1, 1.2)).export(tmp_path / "mug.stl")
    with pytest.raises(InputError, match=r"mug\.stl: the longest side is 1\.2: .* say --unit"):
        _read(tmp_path / "mug.stl", MeshOptions(up="z"))
    scan, _ = _read(tmp_path / "mug.stl", MeshOptions(up="z", unit="0.1"))
    assert scan.mesh.extents.max() == pytest.approx(0.12)


@pytest.mark.parametrize("axis", ["z", "y"])
@pytest.mark.parametrize("kind", ["axial", "mirror"])
def test_up_is_where_the_object_stands(axis, kind):
    cone = trimesh.creation.cone(0.05, 0.12)
    cone.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], AXES[axis]))
    assert guess_up(cone, kind) == axis


@pytest.mark.parametrize("axis", ["z", "y"])
def test_up_is_away_from_the_ground_at_zero(axis):
    packet = trimesh.creation.box((0.08, 0.12, 0.2) if axis == "z" else (0.08, 0.2, 0.12))
    packet.apply_translation(
        0.1 * np.array(AXES[axis])
    )  # lying flat is likelier, and 0 is its foot
    assert guess_up(packet, "mirror") == axis


def test_up_is_what_the_file_states_where_the_shape_does_not_tell():
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    assert (guess_up(box, "mirror"), guess_up(box, "mirror", "y")) == ("z", "y")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"up": "Z"}, "unknown axis 'Z'"),
        ({"unit": "mmm"}, "unknown unit 'mmm'; did you mean mm"),
        ({"unit": "-1"}, "expected a number of metres above 0"),
        ({"category": 5}, "--category is 5; expected text"),
        ({"object_type": "articulated"}, "unknown type 'articulated'"),
    ],
)
def test_wrong_options_are_one_line(options, message):
    with pytest.raises(InputError) as refused:
        MeshOptions(**options)
    assert message in str(refused.value) and "\n" not in str(refused.value)


def test_remarks_say_what_will_be_unknown():
    assert SAID.remarks() == []
    (licence, category) = MeshOptions(category="mugg").remarks()
    assert "no licence" in licence and "did you mean mug?" in category
    assert category.startswith("labelled as mirror, say --type where that is wrong: unknown")


@pytest.mark.full
def test_folder_of_many_builds_but_for_the_bad_ones(tmp_path, capsys):
    folder, out = tmp_path / "in", tmp_path / "out"
    (folder / "crackers").mkdir(parents=True)
    _box().export(folder / "tea.stl")
    _box(textured=True).export(folder / "crackers" / "model.obj")
    (folder / "torn.obj").write_text("v 0 0 0\nv 1 0\nf 1 2 3\n")
    (folder / "noise.glb").write_bytes(b"glTF and then nothing")
    (folder / "empty.stl").write_bytes(b"")
    (folder / "notes.txt").write_text("not a mesh")
    command = ["assets", "build", "meshes", str(folder), "--out", str(out), "--jobs", "1"]
    command += ["--category", "box", "--up", "z", "--unit", "mm", "--type", "mirror"]
    assert main([*command, "--licence", "CC0 1.0"]) == 2
    told = capsys.readouterr()
    assert "2 built, 0 up to date, 3 failed" in told.out
    for name in ("torn.obj", "noise.glb", "empty.stl"):
        (line,) = [line for line in told.err.splitlines() if name in line]
        assert line.startswith(f"manipose: {Path(name).stem}: {folder / name}: ")
    assert sorted(p.name for p in out.iterdir()) == ["crackers", "tea"]
    asset = json.loads((out / "tea" / "asset.json").read_text())
    assert asset["provenance"]["licence"] == "CC0 1.0" and "YCB" not in json.dumps(asset)
    said = MeshOptions("box", "mirror", "z", "mm", "CC0 1.0")
    status = {r.name: r.status for r in build("meshes", folder, out, said=said)}
    assert (status["tea"], status["crackers"], status["torn"]) == ("skipped", "skipped", "failed")
    again = MeshOptions("box", "mirror", "z", "mm", "MIT")
    (result,) = build("meshes", folder, out, said=again, only=["tea"])
    assert result.status == "built"


@pytest.mark.full
def test_a_ball_is_told_to_have_an_axis_that_nobody_sees(tmp_path, caplog):
    trimesh.creation.icosphere(subdivisions=3, radius=25).export(tmp_path / "marble.stl")
    _box().export(tmp_path / "tea.stl")
    command = ["assets", "build", "meshes", str(tmp_path), "--out", str(tmp_path / "out")]
    assert main([*command, "--unit", "mm", "--up", "z", "--jobs", "1"]) == 0
    told = [text for text in caplog.messages if "round on all sides" in text]
    assert len(told) == 1
    assert told[0].startswith("marble: ")


def test_names_that_recur_keep_their_endings(tmp_path):
    for name in ("tea.stl", "tea.ply", "crackers/model.obj"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        _box().export(tmp_path / name)
    names = [item.name for item in meshes.items(tmp_path, SAID)]
    assert names == ["crackers", "tea.ply", "tea.stl"]


def test_no_mesh_is_an_input_error(tmp_path):
    (tmp_path / "notes.txt").write_text("")
    for path, message in (
        (tmp_path, "holds no mesh"),
        (tmp_path / "notes.txt", "no mesh that can be read"),
        (tmp_path / "nowhere", "no such file or folder"),
    ):
        with pytest.raises(InputError, match=message):
            meshes.items(path, SAID)


@pytest.mark.parametrize("source", ["ycb", "catalogue"])
def test_options_are_for_meshes_only(tmp_path, capsys, source):
    command = ["assets", "build", source, str(tmp_path), "--out", str(tmp_path), "--up", "z"]
    assert main(command) == 2
    assert "are for meshes" in capsys.readouterr().err
    with pytest.raises(InputError, match="for the source 'meshes' only"):
        build("ycb", tmp_path, tmp_path, said=SAID)
