"""FoundationPose's reader and bop_toolkit's functions open an exported data set, where two variables name them.

    FOUNDATIONPOSE=FoundationPose BOP_TOOLKIT=bop_toolkit python -m pytest tests/conformance/test_bop_readers.py

Each names the folder of a clone; its code runs as it is. FoundationPose's reader needs OpenCV and imageio, bop_toolkit's
functions imageio and pypng.
"""

from __future__ import annotations

import copy
import glob
import logging
import os
import sys
from types import ModuleType

import numpy as np
import pytest
import trimesh

from manipose_mj.bop import export as exporting
from manipose_mj.bop.dataset import read_data
from manipose_mj.bop.results_csv import read_results
from manipose_mj.ppf_jax.data.view_settings import view_setting
from tests.bop.truth import write_truth

VIEWS = 2
CHOSEN = {"bowl": [4], "mug": [4]}


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Two views of an object with continuous symmetry, and of one without symmetry."""
    folder = tmp_path_factory.mktemp("bop") / "set"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exporting, "split_indices", lambda category, split: CHOSEN[category])
        exporting.export(tuple(CHOSEN), folder, view_setting("anywhere"), views=VIEWS)
    return folder


def folder_of(variable: str) -> str:
    folder = os.environ.get(variable)
    if folder is None:
        pytest.skip(f"{variable} names no folder")
    return folder


@pytest.fixture
def readers(data, monkeypatch):
    """FoundationPose's reader of every scene.

    Its `Utils`, which loads PyTorch and a renderer, is replaced by the modules that the reader takes from there.
    """
    monkeypatch.syspath_prepend(folder_of("FOUNDATIONPOSE"))
    utilities = ModuleType("Utils")
    utilities.__dict__.update(
        np=np,
        glob=glob,
        copy=copy,
        logging=logging,
        trimesh=trimesh,
        cv2=pytest.importorskip("cv2"),
        imageio=pytest.importorskip("imageio.v2"),
    )
    monkeypatch.setitem(sys.modules, "Utils", utilities)
    monkeypatch.delitem(sys.modules, "datareader", raising=False)
    import datareader

    class Reader(datareader.BopBaseReader):
        """With the one method that each data set's reader adds."""

        ob_ids = (1, 2)

        def get_gt_mesh_file(self, ob_id):
            return f"{self.base_dir}/../../models/obj_{ob_id:06d}.ply"

    yield [Reader(str(scene)) for scene in sorted((data / "test").iterdir())]
    sys.modules.pop("datareader", None)


@pytest.fixture
def inout(monkeypatch):
    """Of bop_toolkit."""
    for name in ("imageio", "png"):
        pytest.importorskip(name)
    monkeypatch.syspath_prepend(folder_of("BOP_TOOLKIT"))
    from bop_toolkit_lib import inout

    return inout


def test_foundationposes_reader_opens_every_scene(data, readers):
    """Pictures, depth, masks, K, meshes and poses are those that we read and they agree with each other."""
    targets = read_data(data).targets
    assert len(readers) == len(CHOSEN)
    for scene, reader in enumerate(readers, start=1):
        assert reader.get_video_id() == scene and len(reader.color_files) == VIEWS
        mesh = reader.get_gt_mesh(scene)
        diameter = reader.get_model_diameter(scene)
        assert 0.05 < diameter < 0.4 and mesh.bounding_sphere.primitive.radius * 2 >= 0.9 * diameter
        for frame in range(VIEWS):
            own = next(t for t in targets if (t.scene, t.image) == (scene, frame))
            assert list(reader.get_instance_ids_in_image(frame)) == [scene]
            np.testing.assert_allclose(reader.get_K(frame), own.matrix)
            pose = reader.get_gt_pose(frame, scene)
            np.testing.assert_allclose(pose, own.truth, atol=1e-12)
            np.testing.assert_array_equal(reader.get_gt_poses(frame, scene), pose[None])
            colour, depth = reader.get_color(frame), reader.get_depth(frame)
            visible, whole = (reader.get_mask(frame, scene, k) for k in ("mask_visib", "mask"))
            assert colour.shape == (*depth.shape, 3) and colour.dtype == np.uint8
            assert visible.shape == whole.shape == depth.shape
            assert 0 < visible.sum() <= whole.sum()
            measured = depth[visible & (depth > 0)]
            assert abs(np.median(measured) - pose[2, 3]) < diameter


def test_bop_toolkits_functions_read_every_file(data, inout, tmp_path):
    """JSON files, images, models and results, with its own keys, shapes and units."""
    ours = read_data(data)
    camera = inout.load_cam_params(data / "camera.json")
    assert camera["depth_scale"] == 0.1 and camera["K"].shape == (3, 3)
    targets = inout.load_json(data / "test_targets_bop19.json")
    assert [t["obj_id"] for t in targets] == [t.model for t in ours.targets]
    infos = inout.load_json(data / "models_eval" / "models_info.json", keys_to_int=True)
    assert sorted(infos) == [1, 2] and infos[1]["symmetries_continuous"]
    for number, info in infos.items():
        model = inout.load_ply(data / "models_eval" / f"obj_{number:06d}.ply")
        assert model["faces"].shape[1] == 3 and model["normals"].shape == model["pts"].shape
        np.testing.assert_allclose(model["pts"] / 1000, ours.models[number].vertices, atol=1e-7)
        assert model["colors"].max() > 1
        low, size = model["pts"].min(axis=0), np.ptp(model["pts"], axis=0)
        for axis, least, length in zip("xyz", low, size, strict=True):
            assert info[f"min_{axis}"] == pytest.approx(least, abs=1e-3)
            assert info[f"size_{axis}"] == pytest.approx(length, abs=1e-3)
    for target in ours.targets:
        scene = data / "test" / f"{target.scene:06d}"
        cameras = inout.load_scene_camera(scene / "scene_camera.json")
        (truth,) = inout.load_scene_gt(scene / "scene_gt.json")[target.image]
        np.testing.assert_allclose(cameras[target.image]["cam_K"], target.matrix)
        np.testing.assert_allclose(truth["cam_R_m2c"], target.truth[:3, :3])
        np.testing.assert_allclose(truth["cam_t_m2c"] / 1000, target.truth[:3, 3:])
        name = f"{target.image:06d}"
        depth = inout.load_depth(scene / "depth" / f"{name}.png")
        depth = depth * cameras[target.image]["depth_scale"]
        mask = inout.load_im(scene / "mask_visib" / f"{name}_000000.png") > 0
        assert inout.load_im(scene / "rgb" / f"{name}.png").shape == (*depth.shape, 3)
        seen = np.median(depth[mask & (depth > 0)])
        assert abs(seen - truth["cam_t_m2c"][2, 0]) < infos[target.model]["diameter"]
    results = tmp_path / "truth_set-test.csv"
    write_truth(data, results)
    assert inout.check_bop_results(results) == (True, "OK")
    read = inout.load_bop_results(results)
    assert len(read) == len(read_results(results)) == len(ours.targets)
