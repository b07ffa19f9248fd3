"""The visual meshes of MuJoCo Menagerie's Panda, where they are already on this machine."""

from __future__ import annotations

import importlib.util
import logging
import os
from functools import cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.geometry import MATERIALS
from manipose_mj.mjcf.panda.kinematics import INERTIALS

ROOT_VARIABLE = "MENAGERIE_ROOT"
_ROBOT = "franka_emika_panda"
PREFETCH = f"python -m mujoco_menagerie prefetch {_ROBOT}"

logger = logging.getLogger(__name__)


class VisualMesh(NamedTuple):
    """One coloured mesh of a body: the body's and the material's name, and the file [m]."""

    body: str
    material: str
    file: Path


def find_menagerie_panda() -> Path | None:
    """Menagerie's Panda folder with every mesh that it draws, or None; never downloads.

    Looked for under the environment variable `MENAGERIE_ROOT`; where that is unset, in the cache of the
    `mujoco_menagerie` package. A folder there that is incomplete is warned of, and is None.

    Raises:
        InputError: `MENAGERIE_ROOT` is set and holds no complete folder.
    """
    root = os.environ.get(ROOT_VARIABLE)
    folder = Path(root) / _ROBOT if root else _cached()
    if folder is None:
        return None
    fault = _fault(folder)
    if not fault:
        return folder
    if root:
        raise InputError(
            f"{ROOT_VARIABLE}={root}: {fault}; point it at a complete copy of MuJoCo Menagerie, or unset it"
        )
    _warn_once(f"{fault}; pictures show plain shapes until `{PREFETCH}` has fetched it again")
    return None


def require_menagerie_panda() -> Path:
    """Menagerie's Panda folder.

    Raises:
        InputError: it is not on this machine.
    """
    if folder := find_menagerie_panda():
        return folder
    raise InputError(
        f'visuals="menagerie": no {_ROBOT}/panda.xml; point {ROOT_VARIABLE} at a folder that holds '
        f"{_ROBOT}, or run `{PREFETCH}`"
    )


def _cached() -> Path | None:
    """Where the `mujoco_menagerie` package keeps the folder, if it has fetched it."""
    if not importlib.util.find_spec("mujoco_menagerie"):
        return None
    import mujoco_menagerie  # pyright: ignore[reportMissingImports]

    fetched, robot = mujoco_menagerie.Cache(), mujoco_menagerie.get(_ROBOT)
    return fetched.model_path(robot) if fetched.is_cached(robot) else None


def _fault(folder: Path) -> str:
    """What is wrong with a folder, in one line; "" if nothing is."""
    path = folder / "panda.xml"
    if not path.is_file():
        return f"no {path}"
    try:
        meshes = visual_meshes(folder)
    except ElementTree.ParseError as error:
        return f"{path}: no XML ({error})"
    except KeyError as error:
        return f"{path}: not Menagerie's ({error} is missing)"
    except OSError as error:
        return f"{path}: cannot be read ({error.strerror})"
    if not meshes:
        return f"{path}: draws no mesh"
    for mesh in meshes:
        if mesh.body not in INERTIALS or mesh.material not in MATERIALS:
            return f"{path}: not Menagerie's (body {mesh.body}, material {mesh.material})"
        if not mesh.file.is_file():
            return f"no {mesh.file}, which panda.xml draws"
        if not mesh.file.stat().st_size:
            return f"{mesh.file} is empty"
    return ""


@cache
def _warn_once(message: str) -> None:
    logger.warning("%s", message)


def visual_meshes(folder: Path) -> list[VisualMesh]:
    """The visual meshes that `folder`'s panda.xml draws, in its order.

    Raises:
        KeyError: a body, geom or mesh lacks what Menagerie's have.
        xml.etree.ElementTree.ParseError: the file is no XML.
    """
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
