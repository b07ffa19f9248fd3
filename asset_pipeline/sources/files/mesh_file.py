"""A mesh file of any format that trimesh reads: its surface, its one image or colour, and the files beside it."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from asset_pipeline.sources.files import archives
from asset_pipeline.sources.files.near_files import NearFiles, colour_beside
from asset_pipeline.sources.files.ply_rows import check_rows
from asset_pipeline.sources.files.wavefront_lines import read_lines, without_mark
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

# Names that say nothing about the object: the folder's does.
ANONYMOUS = ("model", "mesh", "object", "scan", "scene", "textured", "texture", "untitled")
METRES = {
    "meters": 1.0, "meter": 1.0, "metres": 1.0, "m": 1.0, "centimeters": 0.01, "centimeter": 0.01, "cm": 0.01,
    "millimeters": 1e-3, "millimeter": 1e-3, "mm": 1e-3, "inches": 0.0254, "inch": 0.0254, "in": 0.0254,
    "feet": 0.3048, "foot": 0.3048, "ft": 0.3048,
}  # fmt: skip
COMPRESSIONS = {b"KHR_draco_mesh_compression": "Draco", b"EXT_meshopt_compression": "meshopt"}
LEAST_OPACITY = 0.15
GREY = (0.7, 0.7, 0.7, 1.0)


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
        _check_compression(path)
    near = NearFiles(path)
    try:
        with without_mark(path) as source:
            loaded = trimesh.load(
                source, file_type=path.suffix[1:].lower(), resolver=near, process=False
            )
        mesh = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
    except Exception as error:  # each of trimesh's readers fails in its own way
        log.info("%s: %s: %s", path, type(error).__name__, error)
        raise InputError(f"{path}: {_reason(path, near)}") from None
    for image, reason in near.unreadable:
        raise InputError(f"{image}: cannot be read as an image ({reason})")
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        hint = "; is it cut off, or something else?" if path.suffix.lower() == ".stl" else ""
        raise InputError(f"{path}: holds no faces; expected a triangle surface{hint}")
    uv = getattr(mesh.visual, "uv", None)
    image, beside = (None, None) if uv is None else _image(mesh, path)
    if lacks := near.lacks():
        log.warning("%s: %s; built with%s", path, lacks, f" {beside.name}" if beside else "out")
    bare = trimesh.Trimesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), process=False)
    if image is not None:
        bare.visual = TextureVisuals(uv=np.nan_to_num(np.asarray(uv, float)))
    elif np.isfinite(bare.vertices).all():  # else it is refused later
        bare.merge_vertices()  # STL has three of its own for every face
    unit = _metres(str(loaded.units).lower()) if _states_unit(path) else None
    return MeshFile(bare, image, _colour(mesh), unit, _stated_up(path))


def _reason(path: Path, near: NearFiles) -> str:
    """Why a reader failed, as far as a person can do something about it."""
    if lacks := near.lacks():
        return f"{lacks}; expected it beside the mesh"
    name = path.suffix[1:].upper()
    return f"cannot be read as {name}; is it cut off, or something else? Export it again"


def _check_compression(path: Path) -> None:
    """Of a compressed glTF trimesh reads zeros."""
    required = re.search(rb'"extensionsRequired"\s*:\s*\[([^\]]*)\]', path.read_bytes())
    for extension, what in COMPRESSIONS.items():
        if required and extension in required[1]:
            raise InputError(
                f"{path}: is compressed by {what}, which is not read; export it without compression"
            )


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


def _image(mesh: trimesh.Trimesh, path: Path) -> tuple[Image.Image | None, Path | None]:
    """What colours the surface, and the file where no material names it."""
    material = getattr(mesh.visual, "material", None)
    found = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if isinstance(found, Image.Image) and not _is_placeholder(found, path):
        return found, None
    beside = colour_beside(path)
    if beside is None:
        return None, None
    try:
        with Image.open(beside) as image:
            return image.convert("RGB"), beside
    except Exception as error:  # each of Pillow's readers fails in its own way
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"{beside}: cannot be read as an image ({reason})") from None


def _is_placeholder(image: Image.Image, path: Path) -> bool:
    """To an OBJ without a material trimesh gives a plain one of 2 x 2 pixels; those of a library say where from."""
    return path.suffix.lower() == ".obj" and max(image.size) <= 2 and "file_path" not in image.info


def _colour(mesh: trimesh.Trimesh) -> tuple[float, float, float, float]:
    """The material's or the vertices' main colour; grey where the file states none. Never invisible."""
    visual = mesh.visual
    source = getattr(visual, "material", visual)
    if source is visual and getattr(visual, "kind", None) not in ("vertex", "face"):
        return GREY
    r, g, b, a = (np.asarray(getattr(source, "main_color"), float) / 255).tolist()  # noqa: B009
    # glTF: what is not said to blend is opaque, whatever its alpha.
    opaque = isinstance(source, PBRMaterial) and source.alphaMode not in ("BLEND", "MASK")
    return r, g, b, 1.0 if opaque else max(a, LEAST_OPACITY)
