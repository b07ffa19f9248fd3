"""A mesh file of any format that trimesh reads: its surface, its one image or colour, and the files beside it."""

from __future__ import annotations

import json
import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image
from trimesh.parent import Geometry

from asset_pipeline.sources.files import archives
from asset_pipeline.sources.files.images import as_rgb, why_unreadable
from asset_pipeline.sources.files.near_files import NearFiles, colour_beside
from asset_pipeline.sources.files.painted_surface import painted_surface
from asset_pipeline.sources.files.ply_rows import check_rows
from asset_pipeline.sources.files.wavefront_lines import for_readers, read_lines
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

# Names that say nothing about the object: the folder's does.
ANONYMOUS = ("model", "mesh", "object", "scan", "scene", "textured", "texture", "untitled")
METRES = {
    "meters": 1.0, "meter": 1.0, "metres": 1.0, "m": 1.0, "centimeters": 0.01, "centimeter": 0.01, "cm": 0.01,
    "millimeters": 1e-3, "millimeter": 1e-3, "mm": 1e-3, "inches": 0.0254, "inch": 0.0254, "in": 0.0254,
    "feet": 0.3048, "foot": 0.3048, "ft": 0.3048, "microns": 1e-6, "micron": 1e-6,
}  # fmt: skip
COMPRESSIONS = {"KHR_draco_mesh_compression": "Draco", "EXT_meshopt_compression": "meshopt"}
TRANSFORM = "KHR_texture_transform"


@dataclass(frozen=True)
class MeshFile:
    """What a mesh file holds.

    Attributes:
      mesh: All of it as one surface, in the file's unit and frame, with `uv` where there is an image.
      image: Colours it, or None. Several materials are packed into one.
      rgba: Of a surface without an image.
      unit: Length of the unit [m] that the format or the file states, or None.
      up: The axis that they state, such as `"y"`, or None.
    """

    mesh: trimesh.Trimesh
    image: Image.Image | None
    rgba: tuple[float, float, float, float]
    unit: float | None
    up: str | None


def read_mesh_file(path: Path) -> MeshFile:
    """Read a file; its texture also where no material names it: an image of the mesh's name, or the only one.

    Textures that it names and that are not there give a warning.

    Raises:
      InputError: It cannot be read, names a buffer that is not there or an image that cannot be read, or holds no
        surface.
    """
    if path.is_file() and path.stat().st_size == 0:
        raise InputError(f"{path}: is empty; expected a mesh")
    if path.suffix.lower() == ".obj":
        if defects := read_lines(path, max_bytes=archives.MAX_FILE_BYTES).defects:
            log.warning("%s: %s", path, "; ".join(defects))
    elif path.suffix.lower() == ".ply":
        check_rows(path)
    elif path.suffix.lower() in (".glb", ".gltf"):
        _check_gltf(path)
    near = NearFiles(path)
    try:
        with for_readers(path) as source:
            loaded = trimesh.load(
                source, file_type=path.suffix[1:].lower(), resolver=near, process=False
            )
    except Exception as error:  # each of trimesh's readers fails in its own way
        log.info("%s: %s: %s", path, type(error).__name__, error)
        raise InputError(f"{path}: {_reason(path, near)}") from None
    for image, reason in near.unreadable:
        raise InputError(f"{image}: cannot be read as an image ({reason})")
    if not _faces(loaded):
        hint = "; is it cut off, or something else?" if path.suffix.lower() == ".stl" else ""
        raise InputError(f"{path}: holds no faces; expected a triangle surface{hint}")
    beside: list[Path] = []
    mesh, image, rgba = painted_surface(
        loaded,
        lambda image: _is_placeholder(image, path),
        lambda: _image_beside(path, beside),
        str(path),
    )
    if lacks := near.lacks():
        log.warning("%s: %s; built with%s", path, lacks, f" {beside[0].name}" if beside else "out")
    if image is None and np.isfinite(mesh.vertices).all():  # else it is refused later
        mesh.merge_vertices()  # STL has three of its own for every face
    unit = _metres(str(loaded.units).lower()) if _states_unit(path) else None
    return MeshFile(mesh, image, rgba, unit, _stated_up(path))


def _faces(loaded: Geometry) -> int:
    pieces = loaded.geometry.values() if isinstance(loaded, trimesh.Scene) else [loaded]
    return sum(len(piece.faces) for piece in pieces if isinstance(piece, trimesh.Trimesh))


def _reason(path: Path, near: NearFiles) -> str:
    """Why a reader failed, as far as a person can do something about it."""
    if lacks := near.lacks():
        return f"{lacks}; expected it beside the mesh"
    name = path.suffix[1:].upper()
    return f"cannot be read as {name}; is it cut off, or something else? Export it again"


def _check_gltf(path: Path) -> None:
    """Refuse what trimesh reads as zeros; tell of images that it puts elsewhere."""
    data = path.read_bytes()
    if data[:4] == b"glTF":  # 12 bytes, then the length of the document and what kind it is
        data = data[20 : 20 + int.from_bytes(data[12:16], "little")]
    try:
        document = json.loads(data)
        required = document.get("extensionsRequired") or []
        compressed = [what for extension, what in COMPRESSIONS.items() if extension in required]
        placed = [
            material.get("pbrMetallicRoughness", {}).get("baseColorTexture", {})
            for material in document.get("materials", [])
        ]
        moved = [
            each
            for each in placed
            if each.get("texCoord") or TRANSFORM in each.get("extensions", {})
        ]
    except (ValueError, AttributeError, TypeError, RecursionError):
        return  # trimesh will say so
    if compressed:
        raise InputError(
            f"{path}: is compressed by {compressed[0]}, which is not read; export it without compression"
        )
    if moved:
        log.warning(
            "%s: images lie on it by %s or a second set of coordinates, which are not read: they will be out of "
            "place; export it with one set of coordinates",
            path, TRANSFORM,
        )  # fmt: skip


def _states_unit(path: Path) -> bool:
    """COLLADA files without a unit are said to be in metres, which nobody who left it out has thought of."""
    return path.suffix.lower() != ".dae" or re.search(rb"<unit\b", path.read_bytes()) is not None


def _metres(text: str) -> float | None:
    """The length of what trimesh calls a unit, such as `"millimeters"` or `"0.01 * meters"`."""
    factor, _, name = text.rpartition(" * ")
    try:
        return METRES[name] * float(factor or 1)
    except (KeyError, ValueError):
        return None


def _stated_up(path: Path) -> str | None:
    """glTF has y up, COLLADA says it in the file."""
    if path.suffix.lower() in (".glb", ".gltf"):
        return "y"
    if path.suffix.lower() != ".dae":
        return None
    stated = re.search(rb"<up_axis>\s*([XYZ])_UP", path.read_bytes())
    return stated.group(1).decode().lower() if stated else "y"


def _image_beside(path: Path, found: list[Path]) -> Image.Image | None:
    """The image of a mesh whose materials name none, whose file is put into `found`."""
    beside = colour_beside(path)
    if beside is None:
        return None
    found.append(beside)
    try:
        with Image.open(beside) as image:
            return as_rgb(image)
    except Exception as error:
        raise InputError(
            f"{beside}: cannot be read as an image ({why_unreadable(error)})"
        ) from None


def _is_placeholder(image: Image.Image, path: Path) -> bool:
    """To an OBJ without a material trimesh gives a plain one of 2 x 2 pixels; those of a library say where from."""
    return path.suffix.lower() == ".obj" and max(image.size) <= 2 and "file_path" not in image.info
