"""Wavefront OBJ files with their materials, read as the small text files they are.

Nothing that a file names is opened but the material library beside it, and an image of the folder
that the caller passes: material libraries in the wild name absolute paths of their authors' machines.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from trimesh.visual import TextureVisuals

from asset_pipeline.articulated_scan import Surface
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

MAX_BYTES = 64 * 2**20  # the largest part of PartNet-Mobility has 5
GREY = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True)
class _Material:
    rgba: tuple[float, float, float, float] = GREY
    texture: Path | None = None


def read_wavefront(path: Path, images: Path) -> tuple[Surface, ...]:
    """The meshes in an OBJ file, one for each material, in the file's own frame and units.

    Polygons become fans of triangles; lines and points are left out, and may leave nothing.

    Args:
      path: The file; its material library, if it names one, lies beside it.
      images: Folder of the textures; only their file names are taken from the library.

    Raises:
      InputError: Missing, too large or no text; a line cannot be read; a face names a vertex that is
        not there; a coordinate is NaN or infinite; or there is no face at all.
    """
    vertices: list[list[float]] = []
    coordinates: list[list[float]] = []
    faces: dict[str, list[tuple[tuple[int, int], ...]]] = {}
    materials: dict[str, _Material] = {}
    material = ""
    for number, line in enumerate(_text(path).splitlines(), start=1):
        keyword, _, rest = line.strip().partition(" ")
        try:
            if keyword == "v":
                vertices.append([float(v) for v in rest.split()[:3]])
                if len(vertices[-1]) != 3:
                    raise ValueError("a vertex has 3 coordinates")
            elif keyword == "vt":
                coordinates.append([float(v) for v in rest.split()[:2]])
                if len(coordinates[-1]) != 2:
                    raise ValueError("a texture coordinate has 2 numbers")
            elif keyword == "f":
                corners = tuple(_corner(c, len(vertices), len(coordinates)) for c in rest.split())
                if len(corners) < 3:
                    raise ValueError("a face has at least 3 corners")
                faces.setdefault(material, []).append(corners)
            elif keyword == "usemtl":
                material = rest.strip()
            elif keyword == "mtllib":
                materials |= _read_materials(path.parent / Path(rest.strip()).name, images)
        except ValueError as error:
            raise InputError(f"{path}: line {number} cannot be read ({error})") from None
    points = np.asarray(vertices, float)
    if not np.isfinite(points).all():
        raise InputError(f"{path}: a vertex is NaN or infinite; expected finite coordinates")
    return tuple(
        _surface(points, coordinates, polygons, materials.get(name, _Material()))
        for name, polygons in faces.items()
    )


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: larger than {MAX_BYTES >> 20} MiB; expected a part's mesh")
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def _corner(text: str, vertices: int, coordinates: int) -> tuple[int, int]:
    """Indices of vertex and texture coordinate, from 0; -1 where a corner has none."""
    fields = text.split("/")
    first = int(fields[0])
    index = first - 1 if first > 0 else vertices + first
    if not 0 <= index < vertices:
        raise ValueError(f"names vertex {first} of {vertices}")
    second = int(fields[1]) if len(fields) > 1 and fields[1] else 0
    uv = second - 1 if second >= 0 else coordinates + second
    return index, uv if 0 <= uv < coordinates else -1


def _surface(
    points: np.ndarray,
    coordinates: list[list[float]],
    polygons: list[tuple[tuple[int, int], ...]],
    material: _Material,
) -> Surface:
    corners = [(p[0], p[i], p[i + 1]) for p in polygons for i in range(1, len(p) - 1)]
    textured = material.texture is not None and all(c[1] >= 0 for t in corners for c in t)
    index = {c: i for i, c in enumerate(dict.fromkeys(c for t in corners for c in t))}
    triangles = np.array([[index[c] for c in t] for t in corners])
    mesh = trimesh.Trimesh(points[[c[0] for c in index]], triangles, process=False)
    if textured:
        uv = np.asarray(coordinates, float)[[c[1] for c in index]]
        mesh.visual = TextureVisuals(uv=np.where(np.isfinite(uv), uv, 0.0))
    return Surface(mesh, material.rgba, material.texture if textured else None)


def _read_materials(path: Path, images: Path) -> dict[str, _Material]:
    """Diffuse colour, opacity and texture by name; what cannot be read stays grey."""
    try:
        lines = _text(path).splitlines()
    except InputError as error:
        log.warning("%s; its meshes are grey", error)
        return {}
    colour: dict[str, list[float]] = {}
    opacity: dict[str, float] = {}
    texture: dict[str, Path] = {}
    name = ""
    for line in lines:
        keyword, _, rest = line.strip().partition(" ")
        try:
            if keyword == "newmtl":
                name = rest.strip()
                colour[name] = list(GREY[:3])
            elif keyword == "Kd":
                red, green, blue = np.clip([float(v) for v in rest.split()[:3]], 0.0, 1.0)
                colour[name] = [float(red), float(green), float(blue)]
            elif keyword == "d":
                opacity[name] = float(np.clip(float(rest), 0.15, 1.0))
            elif keyword == "map_Kd" and rest.split():
                image = images / rest.replace("\\", "/").split("/")[-1].strip()
                if image.is_file() and image.parent == images:
                    texture[name] = image
                else:
                    log.warning("%s: texture %s is not in %s", path, rest.strip(), images)
        except ValueError:
            log.warning("%s: material %r: %r cannot be read", path, name, line.strip())
    return {
        n: _Material((c[0], c[1], c[2], opacity.get(n, 1.0)), texture.get(n))
        for n, c in colour.items()
    }
