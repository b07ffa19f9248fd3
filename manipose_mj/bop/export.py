"""Writing views of the catalogue as a BOP data set: one scene an object, one image a view.

`models/obj_NNNNNN.ply` has its vertices in the frame of the pose label, so that `cam_R_m2c` and `cam_t_m2c` are
`T_camera_label` and every symmetry is about the model's origin.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from jaxtyping import Bool, Float
from PIL import Image
from scipy.spatial.distance import pdist

from manipose_mj.assets.categories import Split
from manipose_mj.assets.label import PoseLabel, symmetry_to_bop
from manipose_mj.bop.dataset import OURS_FILE, TARGETS_FILE
from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.ppf_jax.data.pictures import Picture, label_mesh
from manipose_mj.ppf_jax.data.rendering import Subject
from manipose_mj.ppf_jax.data.view_settings import ViewSetting, task_intrinsics
from manipose_mj.ppf_jax.data.view_stream import (
    SeenObject,
    catalogue_views,
    check_single_views,
    split_indices,
)
from manipose_mj.storage.staging import clear_staging, put_in_place, staging

DEPTH_SCALE = 0.1  # millimetres a step of the depth images
Report = Callable[[int, int, str], None]


def export(
    categories: Sequence[str],
    folder: Path,
    setting: ViewSetting,
    *,
    views: int,
    split: Split = "test",
    jobs: int = 1,
    progress: Report | None = None,
) -> int:
    """Write a data set, whole or not at all; the views are those of `manipose pose evaluate`.

    Args:
      categories: Of the catalogue.
      folder: New.
      setting: From where objects are seen.
      views: Of each object.
      split: Of the catalogue.
      jobs: Processes.
      progress: Told of every finished object.

    Returns:
      How many images there are.

    Raises:
      InputError: The folder exists or cannot be written, or the setting draws objects other than they are.
    """
    check_single_views(setting)
    if folder.exists():
        raise InputError(f"{folder}: exists; choose another --out")
    chosen = [(name, index) for name in categories for index in split_indices(name, split)]
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        clear_staging(folder.parent)
        with staging(folder) as scratch:
            root = scratch / "data"
            for place in ("models", "models_eval", "test"):
                (root / place).mkdir(parents=True)
            work: Any = joblib.Parallel(n_jobs=jobs, return_as="generator")(
                joblib.delayed(_write_object)(root, number, category, index, setting, views)
                for number, (category, index) in enumerate(chosen, 1)
            )
            written = []
            for done, each in enumerate(work, 1):
                written.append(each)
                if progress is not None:
                    progress(done, len(chosen), each["ours"]["name"])
            _write_lists(root, written, setting, views, split)
            put_in_place(root, folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from None
    return len(chosen) * views


def _write_object(
    root: Path, number: int, category: str, index: int, setting: ViewSetting, views: int
) -> dict[str, Any]:
    """Write an object's model and scene; returns its entries of the lists."""
    scene = root / "test" / f"{number:06d}"
    for place in ("rgb", "depth", "mask", "mask_visib", "mask_detected"):
        (scene / place).mkdir(parents=True)
    cameras, poses, infos, entry = {}, {}, {}, {}
    for image, seen in enumerate(catalogue_views(category, index, setting, views)):
        if not image:
            entry = _write_model(root, number, seen.subject)
        cameras[image] = _camera(seen.picture.intrinsics)
        poses[image] = [_pose(number, seen.T_camera_label)]
        infos[image] = [_write_images(scene, image, seen)]
    for name, content in (("camera", cameras), ("gt", poses), ("gt_info", infos)):
        _write_json(scene / f"scene_{name}.json", content)
    return entry


def _write_images(scene: Path, image: int, seen: SeenObject) -> dict[str, Any]:
    """Write the images of a view; returns its entry of `scene_gt_info.json`."""
    own: Picture = seen.picture
    name = f"{image:06d}"
    steps = np.round(own.depth.astype(float) * 1000 / DEPTH_SCALE)
    Image.fromarray(own.rgb).save(scene / "rgb" / f"{name}.png")
    # What is further away than 16 bits reach is not measured.
    depth = np.where(steps <= np.iinfo(np.uint16).max, steps, 0).astype(np.uint16)
    Image.fromarray(depth).save(scene / "depth" / f"{name}.png")
    masks = {"mask": own.silhouette, "mask_visib": own.visible, "mask_detected": own.mask}
    for place, mask in masks.items():
        Image.fromarray(mask.astype(np.uint8) * 255).save(scene / place / f"{name}_000000.png")
    whole, visible = int(own.silhouette.sum()), int(own.visible.sum())
    return {
        "bbox_obj": _box(own.silhouette),
        "bbox_visib": _box(own.visible),
        "px_count_all": whole,
        "px_count_valid": int((own.silhouette & (own.depth > 0)).sum()),
        "px_count_visib": visible,
        "visib_fract": visible / whole if whole else 0.0,
    }


def _write_model(root: Path, number: int, subject: Subject) -> dict[str, Any]:
    """Write a model; returns its entries of `models_info.json` and of our own list."""
    label = subject.label
    mesh = label_mesh(subject)
    mesh.apply_scale(1000.0)
    content: Any = mesh.export(file_type="ply", vertex_normal=True)
    for place in ("models", "models_eval"):
        (root / place / f"obj_{number:06d}.ply").write_bytes(content)
    vertices = np.asarray(mesh.vertices)
    low, size = vertices.min(axis=0), np.ptp(vertices, axis=0)
    # In the label frame; in millimetres all the same, for every symmetry is about its origin.
    centred = PoseLabel(np.zeros(3), np.eye(3), label.object_type, label.extents, label.symmetry)
    listed = symmetry_to_bop(centred, label.symmetry)
    info = {
        "diameter": float(pdist(np.asarray(mesh.convex_hull.vertices)).max()),
        **{f"min_{axis}": float(value) for axis, value in zip("xyz", low, strict=True)},
        **{f"size_{axis}": float(value) for axis, value in zip("xyz", size, strict=True)},
        **{name: each for name, each in listed.items() if each},
    }
    ours = {"name": subject.name, "category": subject.category, "type": label.object_type}
    return {"number": number, "info": info, "ours": ours}


def _write_lists(
    root: Path, written: Sequence[dict[str, Any]], setting: ViewSetting, views: int, split: Split
) -> None:
    """The files of the whole data set."""
    infos = {each["number"]: each["info"] for each in written}
    for place in ("models", "models_eval"):
        _write_json(root / place / "models_info.json", infos)
    largest = task_intrinsics(max(setting.image_heights))
    camera = {name: getattr(largest, name) for name in ("fx", "fy", "cx", "cy", "width", "height")}
    _write_json(root / "camera.json", {**camera, "depth_scale": DEPTH_SCALE})
    targets = [
        {"scene_id": each["number"], "im_id": image, "obj_id": each["number"], "inst_count": 1}
        for each in written
        for image in range(views)
    ]
    _write_json(root / TARGETS_FILE, targets)
    ours = {
        "setting": setting.name,
        "split": split,
        "views": views,
        "manipose_mj": version("manipose-mj"),
        "objects": {each["number"]: each["ours"] for each in written},
    }
    _write_json(root / OURS_FILE, ours)


def _camera(intrinsics: Intrinsics) -> dict[str, Any]:
    return {"cam_K": intrinsics.matrix.ravel().tolist(), "depth_scale": DEPTH_SCALE}


def _pose(number: int, pose: Float[np.ndarray, "4 4"]) -> dict[str, Any]:
    return {
        "cam_R_m2c": pose[:3, :3].ravel().tolist(),
        "cam_t_m2c": (1000 * pose[:3, 3]).tolist(),
        "obj_id": number,
    }


def _box(mask: Bool[np.ndarray, "height width"]) -> list[int]:
    """Left, top, width and height of a mask; -1 where it is empty, as in BOP."""
    rows, columns = np.nonzero(mask)
    if not len(rows):
        return [-1] * 4
    left, top = int(columns.min()), int(rows.min())
    return [left, top, int(columns.max()) - left, int(rows.max()) - top]


def _write_json(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
