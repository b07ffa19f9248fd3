"""A mesh file of any format that trimesh reads: its surface, its one image or colour, and the files beside it."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals

from asset_pipeline.sources.files import archives
from asset_pipeline.sources.files.ply_rows import check_rows
from asset_pipeline.sources.files.wavefront_lines import read_lines
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

# Of the formats that trimesh reads, those of surfaces.
MESHES = (".obj", ".stl", ".ply", ".glb", ".gltf", ".dae", ".off", ".3mf")
IMAGES = (".png", ".jpg", ".jpeg")
_BESIDE = (*IMAGES, ".mtl", ".bin", ".webp", ".bmp", ".tga", ".tif", ".tiff")
# Names that say nothing about the object: the folder's does.
ANONYMOUS = ("model", "mesh", "object", "scan", "scene", "textured", "texture", "untitled")
METRES = {
    "meters": 1.0, "meter": 1.0, "metres": 1.0, "m": 1.0, "centimeters": 0.01, "centimeter": 0.01, "cm": 0.01,
    "millimeters": 1e-3, "millimeter": 1e-3, "mm": 1e-3, "inches": 0.0254, "inch": 0.0254, "in": 0.0254,
    "feet": 0.3048, "foot": 0.3048, "ft": 0.3048,
}  # fmt: skip
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

    Raises:
      InputError: It cannot be read, or holds no surface.
    """
    if path.suffix.lower() == ".obj":
        if defects := read_lines(path, max_bytes=archives.MAX_FILE_BYTES).defects:
            log.warning("%s: %s", path, "; ".join(defects))
    elif path.suffix.lower() == ".ply":
        check_rows(path)
    try:
        loaded = trimesh.load(
            path, process=False
        )  # opens what the file names in its own folder only
        unit = _metres(str(loaded.units).lower())
        mesh = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
    except Exception as error:  # each of trimesh's readers fails in its own way
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"{path}: cannot be read as a mesh ({reason})") from None
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise InputError(f"{path}: holds no faces; expected a triangle surface")
    uv = getattr(mesh.visual, "uv", None)
    image = None if uv is None else _image(mesh, path)
    bare = trimesh.Trimesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), process=False)
    if image is not None:
        bare.visual = TextureVisuals(uv=np.nan_to_num(np.asarray(uv, float)))
    else:
        bare.merge_vertices()  # STL has three of its own for every face
    return MeshFile(bare, image, _colour(mesh), unit, _stated_up(path))


def companions(path: Path) -> list[Path]:
    """The files beside a mesh, or one folder below, that it or its material library names, sorted."""
    near = [
        file
        for pattern in ("*", "*/*")
        for file in path.parent.glob(pattern)
        if file.suffix.lower() in _BESIDE and file.is_file()
    ]
    found: set[Path] = set()
    texts = [path.read_bytes()]
    while texts:
        text = texts.pop()
        for file in near:
            names = {file.name.encode(), quote(file.name).encode()}
            if file not in found and any(name in text for name in names):
                found.add(file)
                texts += [file.read_bytes()] if file.suffix.lower() == ".mtl" else []
    if not any(file.suffix.lower() in IMAGES for file in found) and (image := _beside(path)):
        found.add(image)
    return sorted(found)


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


def _image(mesh: trimesh.Trimesh, path: Path) -> Image.Image | None:
    material = getattr(mesh.visual, "material", None)
    found = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    # To an OBJ without a material trimesh gives a plain one of 2 x 2 pixels.
    if isinstance(found, Image.Image) and (path.suffix.lower() != ".obj" or max(found.size) > 2):
        return found
    beside = _beside(path)
    if beside is None:
        return None
    try:
        with Image.open(beside) as image:
            return image.convert("RGB")
    except Exception as error:  # each of Pillow's readers fails in its own way
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"{beside}: cannot be read as an image ({reason})") from None


def _beside(path: Path) -> Path | None:
    """The image of the mesh's own name, or the only one where the mesh is the only one too."""
    files = [f for f in sorted(path.parent.iterdir()) if f.is_file()]
    images = [f for f in files if f.suffix.lower() in IMAGES]
    named = [f for f in images if f.stem == path.stem]
    alone = len(images) == 1 and sum(f.suffix.lower() in MESHES for f in files) == 1
    return (named or (images if alone else [None]))[0]


def _colour(mesh: trimesh.Trimesh) -> tuple[float, float, float, float]:
    """The material's or the vertices' main colour; grey where the file states none."""
    visual = mesh.visual
    source = getattr(visual, "material", visual)
    if source is visual and getattr(visual, "kind", None) not in ("vertex", "face"):
        return GREY
    r, g, b, a = (np.asarray(getattr(source, "main_color"), float) / 255).tolist()  # noqa: B009
    return r, g, b, a
