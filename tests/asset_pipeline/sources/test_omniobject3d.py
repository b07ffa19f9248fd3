"""OmniObject3D's raw scans, in the layout its README gives; none of the real ones are at hand."""

import numpy as np
import pytest

import tests.asset_pipeline.scan_files as files
from asset_pipeline.sources import omniobject3d as omni
from manipose_mj.errors import InputError

NAMES = ["bottle_001", "bottle_002", "tooth_brush_014"]


def _raw_scans(prefix: str = "raw_scans/", unit: float = 1000.0) -> dict[str, bytes]:
    found = {}
    for name in NAMES:
        # y up, standing on y = 0
        mesh = files.box((0.06 * unit, 0.05 * unit, 0.2 * unit))
        mesh.vertices = mesh.vertices[:, [1, 2, 0]]
        folder = f"{prefix}{name.rpartition('_')[0]}/{name}/Scan/"
        found |= {
            f"{folder}Scan.obj": files.obj(mesh),
            f"{folder}Scan.mtl": b"newmtl material_0\nmap_Kd Scan.jpg\n",
            f"{folder}Scan.jpg": files.jpeg(),
        }
    return found


@pytest.mark.parametrize("packed", [False, True])
def test_whole_set(tmp_path, packed):
    content = _raw_scans()
    root = (
        files.write_archive(tmp_path / "raw.tar.gz", content)
        if packed
        else files.write_folder(tmp_path / "data", content)
    )
    found = omni.items(root)
    assert [item.name for item in found] == NAMES
    with omni.opened(found[0]) as scan:
        assert (scan.category, scan.object_type) == ("bottle", "axial")
        np.testing.assert_allclose(scan.mesh.extents, [0.05, 0.2, 0.06], atol=1e-6)
        np.testing.assert_array_equal(scan.up, [0, 1, 0])
        assert scan.texture.read_bytes() == files.jpeg() and scan.mesh.visual.uv is not None
        assert set(scan.provenance.inputs) == {"Scan.obj", "Scan.jpg"}
    with omni.opened(found[2]) as scan:
        assert (scan.category, scan.object_type) == ("toothbrush", "functional")


def test_category_and_object_alone(tmp_path):
    root = files.write_folder(tmp_path, _raw_scans())
    assert [i.name for i in omni.items(root / "raw_scans")] == NAMES
    assert [i.name for i in omni.items(root / "raw_scans" / "bottle")] == NAMES[:2]
    assert [i.name for i in omni.items(root / "raw_scans" / "bottle" / "bottle_002")] == NAMES[1:2]
    category = {
        k.removeprefix("raw_scans/bottle/"): v
        for k, v in _raw_scans().items()
        if k.startswith("raw_scans/bottle/")
    }
    packed = files.write_archive(tmp_path / "bottle.tar.gz", category)
    assert [i.name for i in omni.items(packed)] == NAMES[:2]


def test_metres_are_named(tmp_path):
    root = files.write_folder(tmp_path, _raw_scans(unit=1.0))
    with (
        pytest.raises(InputError, match="is it in metres. expected millimetres") as error,
        omni.opened(omni.items(root)[0]),
    ):
        pass
    assert "bottle_001/Scan/Scan.obj" in str(error.value)


def test_missing_texture_is_no_error(tmp_path):
    content = {k: v for k, v in _raw_scans().items() if not k.endswith(".jpg")}
    with omni.opened(omni.items(files.write_folder(tmp_path, content))[0]) as scan:
        assert scan.texture is None
