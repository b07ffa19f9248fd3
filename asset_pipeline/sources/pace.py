"""PACE's object models in BOP's format: `models/obj_NNNNNN.ply` with `models_info.json`.

Layout and units (millimetres): https://github.com/qq456cvb/PACE and BOP's format description. The mesh frame
is kept, scaled to metres, since PACE's pose annotations refer to it. z is up: the published symmetry
axes of bowls are z, and bottles are longest along it. `identifier` in `models_info.json` is
`category/instance`; the links of articulated objects have a third part (`scissor/001/link1`) and are left
out. The published symmetry lists are not used: ours are measured.

MIT, but models 693-1260 are Sketchfab's under CC BY 4.0, and 1165 and 1166 GrabCAD's. You et al., ECCV 2024.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from asset_pipeline.sources import collection
from asset_pipeline.sources.categories import Kind, kind_of
from asset_pipeline.sources.files.ply_rows import read_header
from asset_pipeline.sources.files.ply_texture import texture_name
from asset_pipeline.sources.scan import Scan, ScanItem
from manipose_mj.assets.asset import Provenance
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

SOURCE = "PACE"
UNIT = 0.001  # [m]
INFO = "models_info.json"
_PLY = "obj_[0-9][0-9][0-9][0-9][0-9][0-9].ply"
MESHES = (_PLY, f"models/{_PLY}", f"*/models/{_PLY}")
# How far the mesh may be from the size that models_info.json states.
SIZE_TOLERANCE = 0.05


def items(path: Path) -> list[ScanItem]:
    """The rigid objects at `path`: `models`, the folder above it, or an archive of either.

    Raises:
      InputError: `path` does not exist, holds no model, or `models_info.json` cannot be read.
    """
    found = collection.find_items(
        Path(path), what=SOURCE, meshes=MESHES, name=lambda _, mesh: mesh.stem
    )
    return [item for item in found if not _is_link(item)]


def inputs(item: ScanItem) -> dict[str, str]:
    """The sha256 of every file that the object is built from, keyed by file name.

    Raises:
      InputError: The object cannot be read.
    """
    return collection.hashes(item, _files(item))


@contextmanager
def opened(item: ScanItem) -> Iterator[Scan]:
    """Read one object; its texture stays there as long as the context does.

    Raises:
      InputError: The archive or the mesh in it cannot be used, or its size is not the published one.
    """
    info = _info(item)
    kind = _kind(info)
    with collection.unpacked(item, _files(item)) as folder:
        mesh = collection.load_mesh(item, folder, unit=UNIT)
        _check_size(item, np.ptp(mesh.vertices, axis=0), info)
        texture = texture_name(read_header(folder / item.member), f"{item.path}: {item.member}")
        image = None if texture is None else (folder / item.member).with_name(texture)
        yield Scan(
            name=item.name,
            category=kind.category,
            object_type=kind.object_type,
            mesh=mesh,
            texture=image if image is not None and image.is_file() else None,
            up=np.array([0.0, 0.0, 1.0]),
            mass=None,
            provenance=Provenance(SOURCE, item.name, licence(_number(item)), inputs(item)),
        )


def licence(number: int) -> str:
    """Of the model with this number, as PACE's README divides them."""
    if number in (1165, 1166):
        return "GrabCAD Community, non-commercial: see https://grabcad.com/library/squeegee-2"
    return "CC BY 4.0 (Sketchfab)" if 693 <= number <= 1260 else "MIT"


def _is_link(item: ScanItem) -> bool:
    """Whether this is a part of an articulated object; what has no entry fails when it is opened."""
    entry = _all_infos(item).get(str(_number(item)))
    return isinstance(entry, dict) and str(entry.get("identifier")).count("/") >= 2


def _number(item: ScanItem) -> int:
    return int(item.name.removeprefix("obj_"))


def _kind(info: dict[str, Any]) -> Kind:
    return kind_of(str(info["identifier"]).split("/")[0])


def _files(item: ScanItem) -> tuple[PurePosixPath, ...]:
    mesh = PurePosixPath(item.member)
    return mesh, mesh.with_suffix(".png"), mesh.with_suffix(".jpg"), mesh.with_name(INFO)


def _info(item: ScanItem) -> dict[str, Any]:
    """The object's entry in `models_info.json`."""
    entry = _all_infos(item).get(str(_number(item)))
    if not isinstance(entry, dict) or not isinstance(entry.get("identifier"), str):
        raise InputError(
            f"{item.path}: {INFO} has no 'identifier' for object {_number(item)}; "
            "expected category/instance"
        )
    return entry


def _all_infos(item: ScanItem) -> dict[str, Any]:
    member = str(PurePosixPath(item.member).with_name(INFO))
    return _infos(item.path, member, item.path.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _infos(root: Path, member: str, _changed: int) -> dict[str, Any]:
    item = ScanItem("", root, member)
    with collection.unpacked(item, [PurePosixPath(member)]) as folder:
        try:
            infos = json.loads((folder / member).read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            raise InputError(f"{root}: {member}: cannot be read ({error})") from None
    if not isinstance(infos, dict):
        raise InputError(f"{root}: {member}: expected an object keyed by model number")
    return infos


def _check_size(item: ScanItem, extents: np.ndarray, info: dict[str, Any]) -> None:
    """Compare with the published size, which betrays another unit where the extents alone may not."""
    try:
        size = UNIT * np.array([float(info[f"size_{axis}"]) for axis in "xyz"])
    except (KeyError, TypeError, ValueError):
        log.warning(
            "%s: %s states no size of object %d; the unit is taken to be millimetres",
            item.path, INFO, _number(item),
        )  # fmt: skip
        return
    if not np.allclose(extents, size, rtol=SIZE_TOLERANCE, atol=0.002):
        mesh, stated = (" x ".join(f"{1000 * e:.4g}" for e in s) for s in (extents, size))
        raise InputError(
            f"{item.path}: {item.member}: mesh measures {mesh} mm, {INFO} says {stated} mm; "
            "expected a mesh in millimetres"
        )
