"""YCB as published, from archive to an asset that rests; needs the real scans."""

import json
import shutil
import tarfile

import numpy as np
import pytest

from asset_pipeline.build.data_set import build
from asset_pipeline.checks.asset_check import check
from asset_pipeline.sources import ycb
from asset_pipeline.sources.scan import load_scan_mesh
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.errors import InputError
from tests.places import REAL_DATA

YCB = REAL_DATA / "ycb"
BUILT = ("004_sugar_box", "006_mustard_bottle", "043_phillips_screwdriver")
needs_data = pytest.mark.skipif(
    not YCB.is_dir(), reason=f"no YCB scans at {YCB}; set MANIPOSE_REAL_DATA to a folder with ycb/"
)


@pytest.fixture(scope="module")
def assets(tmp_path_factory):
    out = tmp_path_factory.mktemp("ycb_assets")
    seen = []
    results = build("ycb", YCB, out, only=BUILT, progress=lambda r, n: seen.append((r.name, n)))
    assert [(r.name, r.status, r.reason) for r in results] == [(n, "built", "") for n in BUILT]
    assert sorted(seen) == [(n, 3) for n in BUILT]
    return {name: read_asset(out / name) for name in BUILT}


def test_table_covers_the_set_with_plausible_masses():
    assert len({name[:3] for name in ycb.OBJECTS}) >= 60
    grams = [o.grams for o in ycb.OBJECTS.values() if o.grams is not None]
    assert min(grams) > 1 and max(grams) < 1500
    assert ycb.OBJECTS["006_mustard_bottle"].grams == 603
    assert ycb.OBJECTS["065-a_cups"].category == "cup"


@needs_data
def test_every_published_object_is_found_and_known():
    found = ycb.items(YCB)
    assert len(found) == len(list(YCB.glob("*.tgz")))
    assert {item.name for item in found} <= set(ycb.OBJECTS)
    (single,) = ycb.items(YCB / "065-a_cups_google_16k.tgz")
    assert single.name == "065-a_cups"


@pytest.mark.full
@needs_data
def test_mesh_frame_is_the_published_one(assets, tmp_path):
    with tarfile.open(YCB / "006_mustard_bottle_google_16k.tgz") as tar:
        tar.extractall(tmp_path, filter="data")
    mesh = load_scan_mesh(tmp_path / "006_mustard_bottle" / "google_16k" / "textured.obj")
    asset = assets["006_mustard_bottle"]
    built = load_scan_mesh(next((asset.folder / "meshes").glob("*visual*.obj")))
    np.testing.assert_allclose(built.bounds, mesh.bounds, atol=1e-6)
    assert built.visual.uv is not None and next((asset.folder / "meshes").glob("*visual*.png"))


@pytest.mark.full
@needs_data
def test_labels_follow_the_conventions(assets):
    sugar, mustard, driver = (assets[name].label for name in BUILT)
    for label in (sugar, mustard):
        assert label.object_type == "mirror"
        assert label.rotation[2, 0] > np.cos(np.deg2rad(5))  # X is up
        assert label.extents[1] > label.extents[2]  # Y is the longer side
    np.testing.assert_allclose(sugar.extents, [0.175, 0.093, 0.045], atol=0.004)
    assert driver.object_type == "functional"
    assert abs(driver.rotation[2, 0]) < 0.05 and driver.extents.argmax() == 0


@pytest.mark.full
@needs_data
def test_symmetry_is_what_the_shape_has(assets):
    sugar, mustard, driver = (assets[name].label.symmetry for name in BUILT)
    assert len(sugar.rotations) == 4 and not sugar.axial
    assert len(mustard.rotations) == 2 and not mustard.axial  # oval: no body of revolution
    np.testing.assert_allclose(mustard.rotations[1], np.diag([1.0, -1.0, -1.0]), atol=1e-6)
    assert len(driver.rotations) == 2  # its handle is flattened on two sides


@pytest.mark.full
@needs_data
def test_assets_rest_and_can_be_grasped(assets):
    for result in check(assets[BUILT[0]].folder.parent):
        assert result.ok, result.failures
        assert result.part_vertices <= 32 and result.parts <= 32
        assert result.grasps >= 50
    assert assets["006_mustard_bottle"].mass_properties.mass == pytest.approx(0.603)


@pytest.mark.full
@needs_data
def test_second_build_skips_and_changed_input_builds_again(assets, tmp_path):
    out = assets[BUILT[0]].folder.parent
    assert {r.status for r in build("ycb", YCB, out, only=BUILT)} == {"skipped"}
    shutil.copytree(out / BUILT[0], tmp_path / BUILT[0])
    path = tmp_path / BUILT[0] / "asset.json"
    document = json.loads(path.read_text())
    (document["provenance"]["inputs"],) = [dict.fromkeys(document["provenance"]["inputs"], "0")]
    path.write_text(json.dumps(document))
    assert build("ycb", YCB, tmp_path, only=BUILT[:1])[0].status == "built"
    assert path.read_bytes() == (out / BUILT[0] / "asset.json").read_bytes()


@needs_data
def test_unpacked_folder_reads_like_its_archive(tmp_path):
    with tarfile.open(YCB / "065-a_cups_google_16k.tgz") as tar:
        tar.extractall(tmp_path, filter="data")
    (folder,) = ycb.items(tmp_path)
    (alone,) = ycb.items(tmp_path / "065-a_cups")
    assert folder.name == alone.name == "065-a_cups"
    (archive,) = ycb.items(YCB / "065-a_cups_google_16k.tgz")
    with ycb.opened(folder) as a, ycb.opened(archive) as b:
        np.testing.assert_array_equal(a.mesh.vertices, b.mesh.vertices)
        assert (a.name, a.category, a.mass) == (b.name, b.category, b.mass)
        assert a.texture.is_file() and b.texture.is_file()


@needs_data
def test_truncated_download_fails_alone(tmp_path):
    good = YCB / "004_sugar_box_google_16k.tgz"
    (tmp_path / "scans").mkdir()
    torn = tmp_path / "scans" / "003_cracker_box_google_16k.tgz"
    torn.write_bytes((YCB / torn.name).read_bytes()[:200_000])
    shutil.copy(good, tmp_path / "scans")
    results = build("ycb", tmp_path / "scans", tmp_path / "out")
    assert [r.status for r in results] == ["failed", "built"]
    assert str(torn) in results[0].reason and "truncated" in results[0].reason
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["004_sugar_box"]


def test_folder_without_scans_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="holds no YCB object"):
        ycb.items(tmp_path)
