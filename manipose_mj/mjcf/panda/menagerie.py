"""The visual meshes of MuJoCo Menagerie's Panda, where they are already on this machine."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from manipose_mj.errors import InputError

_ROBOT = "franka_emika_panda"


class VisualMesh(NamedTuple):
    """One coloured mesh of a body: the body's and the material's name, and the file [m]."""

    body: str
    material: str
    file: Path


def find_menagerie_panda() -> Path | None:
    """Menagerie's Panda folder, or None; never downloads.

    Looked for under the environment variable `MENAGERIE_ROOT`; where that is unset, in the cache of
    the `mujoco_menagerie` package.
    """
    if root := os.environ.get("MENAGERIE_ROOT"):
        folder = Path(root) / _ROBOT
    elif importlib.util.find_spec("mujoco_menagerie"):
        import mujoco_menagerie  # pyright: ignore[reportMissingImports]

        cache, robot = mujoco_menagerie.Cache(), mujoco_menagerie.get(_ROBOT)
        if not cache.is_cached(robot):
            return None
        folder = cache.model_path(robot)
    else:
        return None
    return folder if (folder / "panda.xml").is_file() else None


def require_menagerie_panda() -> Path:
    """Menagerie's Panda folder.

    Raises:
        InputError: it is not on this machine.
    """
    if folder := find_menagerie_panda():
        return folder
    raise InputError(
        f'visuals="menagerie": no {_ROBOT}/panda.xml; point MENAGERIE_ROOT at a folder that holds '
        f"{_ROBOT}, or run `python -m mujoco_menagerie prefetch {_ROBOT}`"
    )


def visual_meshes(folder: Path) -> list[VisualMesh]:
    """The visual meshes that `folder`'s panda.xml draws, in its order."""
    root = ElementTree.parse(folder / "panda.xml").getroot()
    compiler = root.find("compiler")
    assets = folder if compiler is None else folder / compiler.get("meshdir", "")
    files = {}
    for mesh in root.findall("asset/mesh"):
        file = assets / mesh.attrib["file"]
        files[mesh.get("name", file.stem)] = file
    return [
        VisualMesh(body.attrib["name"], geom.attrib["material"], files[geom.attrib["mesh"]])
        for body in root.iter("body")
        for geom in body.findall("geom")
        if geom.get("class") == "visual"
    ]
