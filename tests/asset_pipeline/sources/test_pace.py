"""PACE's models: BOP's layout, MeshLab's PLY, millimetres; none of the real ones are at hand."""

import json

import numpy as np
import pytest

import tests.asset_pipeline.scan_files as files
from asset_pipeline.build.data_set import build_scan
from asset_pipeline.sources import pace
from asset_pipeline.sources.scan import load_scan_mesh
from manipose_mj.errors import InputError

IDENTIFIERS = {1: "bottle/001", 61: "chip_can/002", 545: "scissor/001/link1", 700: "spanner/0a1b2c"}
SIZE = (60.0, 40.0, 200.0)


def _models(prefix: str = "models/", unit: float = 1.0) -> dict[str, bytes]:
    infos = {}
    found = {}
    for number, identifier in IDENTIFIERS.items():
        mesh = files.box(SIZE)
        mesh.apply_translation([0, 0, -SIZE[2] / 2])
        mesh.apply_scale(unit)
        stem = f"{prefix}obj_{number:06d}"
        found |= {
            f"{stem}.ply": files.meshlab_ply(mesh, f"obj_{number:06d}.png"),
            f"{stem}.png": files.image(),
        }
        infos[str(number)] = {
            "diameter": float(np.linalg.norm(SIZE)),
            **{f"min_{a}": -s / 2 for a, s in zip("xyz", SIZE, strict=True)},
            **{f"size_{a}": s for a, s in zip("xyz", SIZE, strict=True)},
            "identifier": identifier,
            "symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}],
        }
    found[f"{prefix}models_info.json"] = json.dumps(infos).encode()
    return found


def _assert_corners_keep_their_uv(mesh) -> None:
    corners = 0.001 * (files.box(SIZE).vertices - [0, 0, SIZE[2] / 2])
    distances = np.linalg.norm(mesh.vertices[:, None] - corners, axis=2)
    assert distances.min(axis=1).max() < 1e-6
    u = np.linspace(0.1, 0.9, len(corners))[distances.argmin(axis=1)]
    np.testing.assert_allclose(
        mesh.visual.uv, np.stack([u, np.full(len(u), 0.5)], axis=1), atol=1e-5
    )


@pytest.mark.parametrize("prefix", ["", "models/", "pace/models/"])
@pytest.mark.parametrize("packed", [False, True])
def test_rigid_models_are_found_and_keep_their_frame(tmp_path, prefix, packed):
    content = _models(prefix)
    root = (
        files.write_archive(tmp_path / "models.tar.gz", content)
        if packed
        else files.write_folder(tmp_path / "data", content)
    )
    found = pace.items(root)
    assert [item.name for item in found] == ["obj_000001", "obj_000061", "obj_000700"]
    kinds = []
    for item in found:
        with pace.opened(item) as scan:
            kinds.append((scan.category, scan.object_type, scan.provenance.licence))
            np.testing.assert_allclose(scan.mesh.bounds[1], [0.03, 0.02, 0.1], atol=1e-6)
            np.testing.assert_array_equal(scan.up, [0, 0, 1])
            _assert_corners_keep_their_uv(scan.mesh)
            assert scan.texture.read_bytes() == files.image()
            assert set(scan.provenance.inputs) == {
                f"{item.name}.ply",
                f"{item.name}.png",
                "models_info.json",
            }
    assert kinds == [
        ("bottle", "axial", "MIT"),
        ("chips_can", "axial", "MIT"),
        ("spanner", "functional", "CC BY 4.0 (Sketchfab)"),
    ]
    assert pace.licence(1165).startswith("GrabCAD") and pace.licence(1261) == "MIT"


def test_texture_reaches_the_asset(tmp_path):
    item = pace.items(files.write_folder(tmp_path / "data", _models()))[0]
    with pace.opened(item) as scan:
        asset = build_scan(scan, tmp_path / "asset")
    visual = load_scan_mesh(next((asset.folder / "meshes").glob("*visual*.obj")))
    assert visual.visual.uv is not None and next((asset.folder / "meshes").glob("*.png"))
    np.testing.assert_allclose(visual.extents, [0.06, 0.04, 0.2], atol=1e-4)


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        (0.001, "is it in metres. expected millimetres"),
        (0.1, "mesh measures 6 x 4 x 20 mm, models_info.json says 60 x 40 x 200 mm"),
        (1000.0, "expected millimetres"),
    ],
)
def test_another_unit_is_named(tmp_path, unit, message):
    item = pace.items(files.write_folder(tmp_path, _models(unit=unit)))[0]
    with pytest.raises(InputError, match=message) as error, pace.opened(item):
        pass
    assert "obj_000001.ply" in str(error.value)


@pytest.mark.parametrize(
    ("info", "message"),
    [
        (b"{", "cannot be read"),
        (b"[1]", "keyed by model number"),
        (None, "models_info.json"),
    ],
)
def test_unusable_models_info(tmp_path, info, message):
    content = _models()
    content.pop("models/models_info.json")
    if info is not None:
        content["models/models_info.json"] = info
    for root in (
        files.write_folder(tmp_path / "data", content),
        files.write_archive(tmp_path / "models.zip", content),
    ):
        with pytest.raises(InputError, match=message) as error:
            pace.items(root)
        assert "\n" not in str(error.value)


def test_object_without_an_entry_fails_alone(tmp_path):
    content = _models()
    infos = json.loads(content["models/models_info.json"])
    del infos["1"]["identifier"]
    content["models/models_info.json"] = json.dumps(infos).encode()
    bad, good, _ = pace.items(files.write_folder(tmp_path / "data", content))
    with pytest.raises(InputError, match="has no 'identifier' for object 1"), pace.opened(bad):
        pass
    with pace.opened(good):
        pass


@pytest.mark.parametrize("texture", ["../../etc/passwd", "/etc/passwd", "..\\x", None, "none.png"])
def test_texture_stays_beside_the_mesh(tmp_path, texture):
    content = _models()
    content["models/obj_000001.ply"] = files.meshlab_ply(
        files.box(SIZE).apply_translation([0, 0, -SIZE[2] / 2]), texture
    )
    item = pace.items(files.write_folder(tmp_path / "data", content))[0]
    with pace.opened(item) as scan:
        assert scan.texture is None
