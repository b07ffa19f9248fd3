"""Material libraries (MTL) of OBJ files: colours and textures by name, and what looks damaged in them."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asset_pipeline.sources.files.references import leaves
from asset_pipeline.sources.files.wavefront_lines import numbers, read_text
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

MAX_BYTES = 2**20
GREY = (0.7, 0.7, 0.7, 1.0)
# http://paulbourke.net/dataformats/mtl/, and the physically based ones that Blender writes.
KEYWORDS = frozenset({
    "newmtl", "Ka", "Kd", "Ks", "Ke", "Tf", "Ns", "Ni", "Nr", "d", "Tr", "illum", "sharpness",
    "refl", "bump", "disp", "decal", "norm", "Pr", "Pm", "Ps", "Pc", "Pcr", "aniso", "anisor",
    "halo",
})  # fmt: skip


@dataclass(frozen=True)
class Material:
    """Attributes: rgba; texture, the image that colours it, or None; lacks, what is said to colour it and is not there."""

    rgba: tuple[float, float, float, float] = GREY
    texture: Path | None = None
    lacks: str = ""


def read_materials(path: Path, images: Path) -> dict[str, Material]:
    """Diffuse colour, opacity and texture by name; what cannot be read stays grey, with a warning.

    Images that are not there are no warning: each material says what it lacks.

    Args:
      path: The library, at most one folder below the object's.
      images: Folder of the textures; only their file names are taken from the library.
    """
    try:
        text = read_text(path, max_bytes=MAX_BYTES)
    except InputError as error:
        log.warning("%s; its meshes are grey", error)
        return {}
    colour: dict[str, list[float]] = {}
    opacity: dict[str, float] = {}
    texture: dict[str, Path] = {}
    lacks: dict[str, str] = {}
    defects: list[str] = []
    name = None
    for number, line in enumerate(text.split("\n"), start=1):
        keyword, _, rest = line.strip().partition(" ")
        try:
            if keyword == "newmtl":
                name = rest.strip()
                colour[name] = list(GREY[:3])
            elif keyword and not keyword.startswith(("#", "map_")) and keyword not in KEYWORDS:
                raise ValueError(f"{keyword[:20]!r} is no keyword of MTL")
            elif name is None and keyword and not keyword.startswith("#"):
                raise ValueError("before any newmtl")
            elif keyword == "Kd" and name is not None:
                red, green, blue = np.clip(numbers(rest, 3, "a colour has 3 numbers"), 0.0, 1.0)
                colour[name] = [float(red), float(green), float(blue)]
            elif keyword == "d" and name is not None:
                opacity[name] = float(
                    np.clip(numbers(rest, 1, "an opacity is a number")[0], 0.15, 1.0)
                )
            elif keyword == "map_Kd" and name is not None:
                if image := _image(rest.strip(), images, defects):
                    texture[name] = image
                else:
                    lacks[name] = f"texture {rest.strip()!r} is not in {images.name}"
            elif keyword.startswith("map_") and not re.fullmatch(r"map_[A-Za-z]+", keyword):
                raise ValueError(f"{keyword[:20]!r} is no keyword of MTL")
        except ValueError as error:
            defects.append(f"line {number} cannot be read ({error})")
    if not colour:
        defects.append("it defines no material")
    if defects:
        log.warning("%s: %s", path, "; ".join(defects))
    return {
        n: Material((c[0], c[1], c[2], opacity.get(n, 1.0)), texture.get(n), lacks.get(n, ""))
        for n, c in colour.items()
    }


def _image(name: str, images: Path, defects: list[str]) -> Path | None:
    """The image of that file name in `images`, wherever the library says that it lies."""
    last = re.split(r"[/\\]", name)[-1]
    if leaves(name, depth=1):
        defects.append(f"it names {name!r}, outside the object's folder, which is not opened")
    image = images / last if last.isprintable() and last not in ("", ".", "..") else None
    return image if image is not None and image.is_file() else None
