"""PartNet-Mobility as published: folders `<id>/` with `mobility.urdf`, its part meshes and semantics.

Meshes have no unit and y up; the URDF's base joint turns them z up with the front towards -x. An object
becomes metric by the lengths of its category (`sizes.SIZES`). Doors, drawers, knobs and buttons come out shut;
a link that hangs on another moving link is taken as fixed to it, and one that floats as fixed where it
is, each with a warning. https://sapien.ucsd.edu, non-commercial research, no redistribution.
"""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from glob import escape
from pathlib import Path, PurePosixPath
from typing import Any

from asset_pipeline.sources import collection
from asset_pipeline.sources.articulated_scan import ArticulatedScan, ScanLink
from asset_pipeline.sources.partnet_mobility.links import normalised_links, placed_links
from asset_pipeline.sources.partnet_mobility.record import Semantics, compare_links
from asset_pipeline.sources.partnet_mobility.sizes import BODIES, SIZES, TABLE, CategorySize
from asset_pipeline.sources.partnet_mobility.urdf import mesh_files, read_urdf
from asset_pipeline.sources.scan import ScanItem
from manipose_mj.assets.asset import Provenance
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

SOURCE = "PartNet-Mobility v2"
LICENCE = "PartNet-Mobility terms of use: non-commercial research, no redistribution"
URDF = "mobility.urdf"
FILES = (URDF, "mobility_v2.json", "semantics.txt", "meta.json", "bounding_box.json")
# In an asset's inputs: what was said of it.
SAID = "as said"


@dataclass(frozen=True)
class FurnitureItem(ScanItem):
    """An object, and the licence that was said of it; None is the data set's."""

    licence: str | None = None


def items(path: Path, licence: str | None = None) -> list[FurnitureItem]:
    """The objects at `path`: one object's folder, a folder of them, or of `dataset/`, or an archive.

    Args:
      path: The folder or archive.
      licence: Of one's own objects in this layout, under which they may be used.

    Raises:
      InputError: `path` does not exist or holds no object, or is a URDF and not its folder.
    """
    if path.is_file() and path.suffix.lower() == ".urdf":
        name = "" if path.name == URDF else f"; name it {URDF} there"
        raise InputError(
            f"{path}: is one file of an object; expected the folder that it is in{name}"
        )
    found = collection.find_items(
        path,
        what="PartNet-Mobility",
        meshes=(URDF, f"*/{URDF}", f"dataset/*/{URDF}"),
        name=lambda root, urdf: collection.folder_name(root, urdf.parent),
        inside=("*.zip",),
    )
    return [FurnitureItem(item.name, item.path, item.member, licence) for item in found]


def inputs(item: FurnitureItem) -> dict[str, str]:
    """The sha256 of every file that the object is built from, keyed by file name; and the licence that was said."""
    said = {SAID: f"licence={item.licence}"} if item.licence else {}
    return collection.hashes(item, _members(item)) | said


@contextmanager
def opened(item: FurnitureItem) -> Iterator[ArticulatedScan]:
    """Read one object; its textures stay there as long as the context does.

    Raises:
      InputError: The archive, the URDF or a mesh cannot be used, or the size of its category is unknown.
    """
    with collection.unpacked(item, _members(item)) as folder:
        try:
            scan = _scan(item, (folder / item.member).parent)
        except InputError as error:
            # The folder of an unpacked archive is gone by the time anyone reads the message.
            message = str(error).replace(str(folder), str(item.path))
            raise InputError(
                message if item.where in message else f"{item.where}: {message}"
            ) from None
        yield scan


def _members(item: ScanItem) -> list[PurePosixPath]:
    folder = PurePosixPath(item.member).parent
    meshes = [folder / file for file in _named_meshes(item)]
    names = [str(folder / name) for name in (*FILES, "textured_objs/*", "images/*")]
    libraries = {f"{escape(str(mesh.parent))}/*.mtl" for mesh in meshes}
    found = map(PurePosixPath, collection.find(item.path, [*names, *sorted(libraries)]))
    return sorted({*found, *meshes})


def _named_meshes(item: ScanItem) -> list[PurePosixPath]:
    """The meshes that the URDF names, wherever in its folder; none where it cannot be read, which `_scan` tells."""
    try:
        with collection.unpacked(item, [PurePosixPath(item.member)]) as root:
            return mesh_files(root / item.member)
    except InputError:
        return []


def _scan(item: FurnitureItem, folder: Path) -> ArticulatedScan:
    semantics = _semantics(folder)
    size = _size(folder, semantics)
    urdf = read_urdf(folder / URDF)
    compare_links(folder, urdf, semantics)
    base, moving = placed_links(normalised_links(folder, urdf, semantics), size)
    return ArticulatedScan(
        name=item.name,
        category=size.category,
        base=base,
        moving=tuple(_named(moving)),
        appliance=size.appliance,
        provenance=Provenance(SOURCE, item.name, item.licence or LICENCE, inputs(item)),
    )


def _named(moving: list[ScanLink]) -> Iterator[ScanLink]:
    """Links named for their role and their number in the source: `door_0`, `drawer_12`."""
    taken: set[str] = set()
    for index, link in enumerate(moving):
        number = re.search(r"\d+$", link.name)
        name = f"{link.role}_{number.group() if number else index}"
        while name in taken:
            name += "x"
        taken.add(name)
        yield replace(link, name=name)


def _semantics(folder: Path) -> dict[str, Semantics]:
    """What each link is: from `semantics.txt`, else from `mobility_v2.json`, else unknown."""
    text = folder / "semantics.txt"
    if text.is_file():
        content = text.read_text("utf-8", "replace")
        if not content.endswith("\n"):
            log.warning("%s: does not end with a newline and may be cut off", text)
        rows = [line.split() for line in content.splitlines()]
        if odd := [" ".join(r) for r in rows if len(r) != 3]:
            log.warning("%s: %r is not link, motion and name; left out", text, odd[0][:60])
        return {r[0]: Semantics(r[1], r[2]) for r in rows if len(r) == 3}
    log.warning("%s: missing; links are told apart by mobility_v2.json", text)
    document = _json(folder / "mobility_v2.json")
    return {
        f"link_{e['id']}": Semantics(str(e.get("joint", "")), str(e.get("name", "")))
        for e in (document if isinstance(document, list) else [])
        if isinstance(e, dict) and "id" in e
    }


def _size(folder: Path, semantics: dict[str, Semantics]) -> CategorySize:
    meta = _json(folder / "meta.json")
    category = meta.get("model_cat") if isinstance(meta, dict) else None
    by_body = next((BODIES[s.name] for s in semantics.values() if s.name in BODIES), None)
    if None not in (category, by_body) and by_body != category and (category, by_body) != TABLE:
        log.warning(
            "%s: the category is %s, but the body that of %s; the size is that of the category",
            folder / "meta.json", category, by_body,
        )  # fmt: skip
    if category is None:
        category = by_body
        log.warning(
            "%s: does not say the category; by semantics.txt it is %s",
            folder / "meta.json",
            category,
        )
    if not isinstance(category, str) or category not in SIZES:
        raise InputError(
            f"{folder}: category {category!r} has no known size; known: {', '.join(SIZES)}"
        )
    return SIZES[category]


def _json(path: Path) -> Any:
    if not path.is_file():
        return None
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not valid JSON ({error})") from None
