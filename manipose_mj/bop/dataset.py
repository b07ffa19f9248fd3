"""Reading a data set in BOP's layout: models, and the poses that estimates are scored against."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float

from manipose_mj.bop.symmetries import ModelSymmetry, model_symmetry
from manipose_mj.errors import InputError
from manipose_mj.poses import compose

TARGETS_FILE, OURS_FILE = "test_targets_bop19.json", "manipose.json"


@dataclass(frozen=True)
class Model:
    """An object.

    Attributes:
      vertices: `(n, 3)` [m], model frame.
      diameter: Largest distance between two vertices [m].
      symmetry: What leaves it unchanged.
      category, object_type: As our own data sets say; empty in others.
    """

    vertices: Float[np.ndarray, "n 3"]
    diameter: float
    symmetry: ModelSymmetry
    category: str
    object_type: str


@dataclass(frozen=True)
class Target:
    """An object to be found in an image.

    Attributes:
      scene, image, model: Their numbers.
      truth: `T_camera_model` [m].
      matrix: The camera's K.
      width: Of the image [pixels].
    """

    scene: int
    image: int
    model: int
    truth: Float[np.ndarray, "4 4"]
    matrix: Float[np.ndarray, "3 3"]
    width: int

    @property
    def key(self) -> tuple[int, int, int]:
        """Scene, image and model."""
        return self.scene, self.image, self.model


@dataclass(frozen=True)
class BopData:
    """Attributes: models: by number; targets: every object that is to be found."""

    models: Mapping[int, Model]
    targets: tuple[Target, ...]


def read_data(folder: Path) -> BopData:
    """A data set, such as `manipose pose export` writes.

    Raises:
      InputError: A file is missing or cannot be read, or an image shows an object more than once.
    """
    targets = read_json(folder / TARGETS_FILE)
    if not isinstance(targets, list):
        raise InputError(f"{folder / TARGETS_FILE}: expected a list of targets")
    width = _count(read_json(folder / "camera.json"), "width", folder / "camera.json")
    scenes: dict[int, tuple[dict[str, Any], dict[str, Any]]] = {}
    found = []
    for entry in targets:
        where = folder / TARGETS_FILE
        scene, image, number = (_count(entry, k, where) for k in ("scene_id", "im_id", "obj_id"))
        if _field(entry, "inst_count", where) != 1:
            raise InputError(f"{where}: several instances of object {number} in image {image}")
        if scene not in scenes:
            place = folder / "test" / f"{scene:06d}"
            scenes[scene] = (
                read_json(place / "scene_gt.json"),
                read_json(place / "scene_camera.json"),
            )
        poses, cameras = scenes[scene]
        where = folder / "test" / f"{scene:06d}" / "scene_gt.json"
        shown = _field(poses, str(image), where)
        own = [p for p in shown if isinstance(p, dict) and p.get("obj_id") == number]
        if len(own) != 1:
            raise InputError(f"{where}: image {image} has object {number} {len(own)} times")
        try:
            rotation = np.array(own[0]["cam_R_m2c"], float).reshape(3, 3)
            truth = compose(rotation, np.array(own[0]["cam_t_m2c"], float).reshape(3) / 1000)
            matrix = np.array(cameras[str(image)]["cam_K"], float).reshape(3, 3)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{where}: image {image} cannot be read ({error!r})") from None
        found.append(Target(scene, image, number, truth, matrix, width))
    if not found:
        raise InputError(f"{folder / TARGETS_FILE}: no targets")
    return BopData(_models(folder, {target.model for target in found}), tuple(found))


def read_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises:
      InputError: It is missing, or not JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error})") from None


def _models(folder: Path, numbers: set[int]) -> dict[int, Model]:
    place = next((p for p in (folder / "models_eval", folder / "models") if p.is_dir()), None)
    if place is None:
        raise InputError(f"{folder}: no folder models_eval or models")
    infos = read_json(place / "models_info.json")
    ours = read_json(folder / OURS_FILE) if (folder / OURS_FILE).is_file() else {}
    described = ours.get("objects", {})
    models = {}
    for number in sorted(numbers):
        info, path = _field(infos, str(number), place / "models_info.json"), _ply(place, number)
        own = described.get(str(number), {})
        try:
            mesh: Any = trimesh.load(path, force="mesh", process=False)
            models[number] = Model(
                vertices=np.asarray(mesh.vertices, float) / 1000,
                diameter=float(info["diameter"]) / 1000,
                symmetry=model_symmetry(info),
                category=own.get("category", ""),
                object_type=own.get("type", ""),
            )
        except (OSError, LookupError, TypeError, ValueError) as error:
            raise InputError(f"{place}: model {number} cannot be read ({error!r})") from None
    return models


def _ply(place: Path, number: int) -> Path:
    path = place / f"obj_{number:06d}.ply"
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    return path


def _field(entry: Any, name: str, path: Path) -> Any:
    if not isinstance(entry, dict) or name not in entry:
        raise InputError(f"{path}: {name!r} is missing")
    return entry[name]


def _count(entry: Any, name: str, path: Path) -> int:
    value = _field(entry, name, path)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise InputError(f"{path}: {name} is {value!r}; expected a whole number")
    return value
