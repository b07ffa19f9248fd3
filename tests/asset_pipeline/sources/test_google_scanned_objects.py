"""Google Scanned Objects in both published layouts; the real ones where they are."""

import numpy as np
import pytest

import tests.asset_pipeline.scan_files as files
from asset_pipeline.build.data_set import SOURCES, build
from asset_pipeline.sources import google_scanned_objects as gso
from asset_pipeline.sources import ycb
from asset_pipeline.sources.categories import FALLBACK_TYPE, SYNONYMS, kind_of, kind_of_product
from asset_pipeline.sources.files import archives
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.errors import InputError
from tests.places import REAL_DATA

REAL = REAL_DATA / "google_scanned_objects.tar.xz"
needs_data = pytest.mark.skipif(
    not REAL.is_file(),
    reason=f"no {REAL}; set MANIPOSE_REAL_DATA to a folder with google_scanned_objects.tar.xz",
)
NAMES = ["Acme_Coffee_Mug", "Acme_Hammer_Red", "Zyx"]


def _mujoco_layout(prefix: str = "models/") -> dict[str, bytes]:
    found = {}
    for index, name in enumerate(NAMES):
        mesh = files.obj(files.box((0.05 + 0.01 * index, 0.06, 0.07)))
        found |= {
            f"{prefix}{name}/model.obj": mesh,
            f"{prefix}{name}/texture.png": files.image(),
            f"{prefix}{name}/model.xml": b"<mujoco/>",
            f"{prefix}{name}/model_collision_0.obj": b"nothing to read",
        }
    return found


def _fuel_layout() -> dict[str, bytes]:
    return {
        "meshes/model.obj": files.obj(files.box((0.05, 0.06, 0.07))),
        "meshes/model.mtl": b"newmtl material_0\n",
        "materials/textures/texture.png": files.image(),
        "model.sdf": b"<sdf/>",
        "thumbnails/0.jpg": b"",
    }


@pytest.mark.parametrize("where", ["models/", "", "mujoco_scanned_objects-main/models/"])
@pytest.mark.parametrize("ending", ["folder", "zip", "tar.xz", "tgz"])
def test_folder_and_archive_give_the_same_objects(tmp_path, where, ending):
    content = _mujoco_layout(where)
    if ending == "folder":
        root = files.write_folder(tmp_path / "data", content)
    else:
        root = files.write_archive(tmp_path / f"data.{ending}", content)
    found = gso.items(root)
    assert [item.name for item in found] == NAMES
    item = found[1]
    assert set(gso.inputs(item)) == {"model.obj", "texture.png"}
    with gso.opened(item) as scan:
        assert (scan.category, scan.object_type, scan.mass) == ("hammer", "functional", None)
        np.testing.assert_allclose(scan.mesh.extents, [0.06, 0.06, 0.07], atol=1e-6)
        np.testing.assert_allclose(scan.mesh.bounds[0, 2], 0, atol=1e-6)
        np.testing.assert_array_equal(scan.up, [0, 0, 1])
        assert scan.mesh.visual.uv is not None and scan.texture.read_bytes() == files.image()
        assert scan.provenance.licence == "CC BY 4.0"
        kept = scan.texture
    assert kept.exists() == (ending == "folder")


def test_inputs_do_not_depend_on_the_packing(tmp_path):
    content = _mujoco_layout()
    folder = gso.items(files.write_folder(tmp_path / "a", content))[0]
    for name in ("a.zip", "a.tar.xz"):
        packed = gso.items(files.write_archive(tmp_path / name, content))[0]
        assert gso.inputs(packed) == gso.inputs(folder)


def test_fuels_zips_are_read_as_they_come(tmp_path):
    for name in NAMES[:2]:
        files.write_archive(tmp_path / f"{name}.zip", _fuel_layout())
    files.write_folder(tmp_path / NAMES[2], _fuel_layout())
    found = gso.items(tmp_path)
    assert [item.name for item in found] == NAMES
    for item in found:
        with gso.opened(item) as scan:
            assert scan.texture is not None and scan.texture.is_file()
    (single,) = gso.items(tmp_path / f"{NAMES[0]}.zip")
    (folder,) = gso.items(tmp_path / NAMES[2])
    assert (single.name, folder.name) == (NAMES[0], NAMES[2])


def test_torn_zip_fails_alone(tmp_path):
    good = files.write_archive(tmp_path / "Acme_Box.zip", _fuel_layout())
    (tmp_path / "Torn_Box.zip").write_bytes(good.read_bytes()[:300])
    found = {item.name: item for item in gso.items(tmp_path)}
    assert sorted(found) == ["Acme_Box", "Torn_Box"]
    with gso.opened(found["Acme_Box"]):
        pass
    with pytest.raises(InputError, match="Torn_Box.zip"), gso.opened(found["Torn_Box"]):
        pass


def test_millimetres_are_named_and_no_scratch_folder_is(tmp_path):
    content = _mujoco_layout()
    content["models/Zyx/model.obj"] = files.obj(files.box((50, 60, 70)))
    root = files.write_archive(tmp_path / "data.zip", content)
    with (
        pytest.raises(InputError, match="is it in millimetres. expected metres") as error,
        gso.opened(gso.items(root)[2]),
    ):
        pass
    assert str(error.value).startswith(f"{root}/models/Zyx/model.obj: ")


@pytest.mark.parametrize("name", ["../evil", "/evil", "x/../../evil", "..\\evil"])
def test_zip_that_leaves_its_folder(tmp_path, name):
    root = files.write_archive(tmp_path / "a.zip", {"x/model.obj": b"", name: b""})
    with pytest.raises(InputError, match="leaves the folder"):
        gso.items(root)


def test_zip_with_a_link(tmp_path):
    import zipfile

    root = tmp_path / "a.zip"
    with zipfile.ZipFile(root, "w") as archive:
        link = zipfile.ZipInfo("x/model.obj")
        link.external_attr = 0o120777 << 16
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(InputError, match="is a link"):
        gso.items(root)


@pytest.mark.parametrize("ending", ["zip", "tar.xz", "tar.bz2"])
def test_bomb_is_refused(tmp_path, monkeypatch, ending):
    monkeypatch.setattr(archives, "MAX_FILE_BYTES", 100_000)
    root = files.write_archive(tmp_path / f"a.{ending}", {"x/model.obj": bytes(200_000)})
    assert root.stat().st_size < 2000
    with pytest.raises(InputError, match="too large to unpack"):
        for item in gso.items(root):
            gso.inputs(item)


@pytest.mark.parametrize("ending", ["zip", "tgz", "tar.xz", "tar.bz2", "tar"])
def test_verify_sees_a_flipped_byte_and_a_cut(tmp_path, ending):
    noise = np.random.default_rng(0).bytes(50_000)
    path = files.write_archive(tmp_path / f"a.{ending}", {"x/noise": noise, "y": b"y"})
    archives.verify(path)
    data = bytearray(path.read_bytes())
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=str(path)):
        archives.verify(path)
    if ending == "tar":
        return  # has checksums of its headers only
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match=str(path)):
        archives.verify(path)


def test_nothing_there_is_an_input_error(tmp_path):
    for path, message in ((tmp_path, "holds no object"), (tmp_path / "x", "no such file")):
        with pytest.raises(InputError, match=message):
            gso.items(path)
    (tmp_path / "a.zip").write_bytes(b"PK no zip")
    with pytest.raises(InputError, match="truncated, or not a zip"):
        gso.items(tmp_path / "a.zip")


@pytest.mark.parametrize(
    ("name", "category", "object_type"),
    [
        ("Room_Essentials_Mug_White_Yellow", "mug", "mirror"),
        ("ACE_Coffee_Mug_Kristen_16_oz_cup", "mug", "mirror"),
        ("Cole_Hardware_Hammer_Black", "hammer", "functional"),
        ("Craftsman_Grip_Screwdriver_Phillips_Cushion", "screwdriver", "functional"),
        ("Threshold_Salad_Plate_Square_Rim_Porcelain", "plate", "axial"),
        ("Ecoforms_Plant_Pot_GP9_SAND", "flower_pot", "axial"),
        ("Razer_Taipan_White_Ambidextrous_Gaming_Mouse", "computer_mouse", "mirror"),
        ("Wishbone_Pencil_Case", "household_item", FALLBACK_TYPE),
        ("BlueBowl", "bowl", "axial"),
        ("Seasoning_25_oz_4_cup", "household_item", FALLBACK_TYPE),
        ("", "household_item", FALLBACK_TYPE),
    ],
)
def test_products_are_told_by_the_words_of_their_names(name, category, object_type):
    kind = kind_of_product(name)
    assert (kind.category, kind.object_type) == (category, object_type)


def test_categories_lead_to_ours():
    assert {SYNONYMS[k] for k in SYNONYMS} <= set(CATALOGUE)
    for name, row in CATALOGUE.items():
        assert kind_of(name).category == name and kind_of(name).object_type == row.object_type
    assert kind_of("Chip-Can").category == "chips_can"
    assert kind_of("pineapple").object_type == "axial"
    assert kind_of("sofa").object_type == FALLBACK_TYPE
    # Bottles and cans that are no bodies of revolution.
    own = {"006_mustard_bottle", "010_potted_meat_can", "021_bleach_cleanser", "022_windex_bottle"}
    for name, entry in ycb.OBJECTS.items():
        if entry.category in CATALOGUE and name not in own:
            assert entry.object_type == CATALOGUE[entry.category].object_type, name


def test_the_sources_are_registered():
    assert {"google_scanned_objects", "omniobject3d", "pace", "ycb"} <= set(SOURCES)


@needs_data
def test_real_objects_have_the_size_of_real_ones():
    found = gso.items(REAL)
    assert len(found) == 8
    item = next(i for i in found if i.name == "Room_Essentials_Mug_White_Yellow")
    with gso.opened(item) as scan:
        assert scan.category == "mug" and scan.texture is not None
        assert scan.mesh.bounds[0, 2] == pytest.approx(0, abs=1e-3)
        assert scan.mesh.extents[2] == pytest.approx(0.105, abs=0.002)


@pytest.mark.full
@needs_data
def test_real_plate_builds(tmp_path):
    name = "Room_Essentials_Salad_Plate_Turquoise"
    (result,) = build("google_scanned_objects", REAL, tmp_path, only=[name])
    assert (result.status, result.reason) == ("built", "")
    asset = read_asset(tmp_path / name)
    assert asset.category == "plate" and asset.label.symmetry.axial
    assert asset.label.rotation[2, 0] > 0.999
    assert set(asset.provenance.inputs) == {"model.obj", "texture.png"}
    assert build("google_scanned_objects", REAL, tmp_path, only=[name])[0].status == "skipped"
