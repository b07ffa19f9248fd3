"""Google Scanned Objects: `models/<name>/model.obj` with `texture.png`, or Fuel's `<name>.zip`.

The first is the layout of https://github.com/kevinzakka/mujoco_scanned_objects (meshes as Google published
them, textures at a quarter of the resolution, collision meshes that are not read: we make our own); the
second what https://app.gazebosim.org/GoogleResearch serves, zipped or unpacked. Units are metres, z is up,
the base stands at z = 0 (seen on the objects at hand; the publisher states it nowhere we found). No mass is
published. CC BY 4.0; Downs et al., "Google Scanned Objects", ICRA 2022.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path, PurePosixPath

from asset_pipeline.sources import collection
from asset_pipeline.sources.categories import kind_of_product
from asset_pipeline.sources.scan import Scan, ScanItem

SOURCE = "Google Scanned Objects"
LICENCE = "CC BY 4.0"
MESHES = (
    "model.obj",
    "*/model.obj",
    "models/*/model.obj",
    "*/models/*/model.obj",  # as GitHub archives the repository
    "meshes/model.obj",
    "*/meshes/model.obj",
)


def items(path: Path) -> list[ScanItem]:
    """The objects at `path`: the data set's folder or archive, one object, or a folder of zips.

    Raises:
      InputError: `path` does not exist or holds no such object.
    """
    return collection.find_items(
        Path(path), what=SOURCE, meshes=MESHES, name=_name, inside=("*.zip",)
    )


def inputs(item: ScanItem) -> dict[str, str]:
    """The sha256 of every file that the object is built from, keyed by file name.

    Raises:
      InputError: The object cannot be read.
    """
    return collection.hashes(item, _files(item))


def opened(item: ScanItem) -> AbstractContextManager[Scan]:
    """Read one object; its texture stays there as long as the context does.

    Raises:
      InputError: The archive or the mesh in it cannot be used.
    """
    return collection.opened_scan(
        item,
        _files(item),
        kind=kind_of_product(item.name),
        up=(0.0, 0.0, 1.0),
        source=SOURCE,
        licence=LICENCE,
    )


def _name(root: Path, mesh: PurePosixPath) -> str:
    folder = mesh.parent.parent if mesh.parent.name == "meshes" else mesh.parent
    return collection.folder_name(root, folder)


def _files(item: ScanItem) -> tuple[PurePosixPath, ...]:
    """The mesh, and where its texture may be."""
    mesh = PurePosixPath(item.member)
    folder = mesh.parent.parent if mesh.parent.name == "meshes" else mesh.parent
    return (
        mesh,
        mesh.with_name("texture.png"),
        folder / "materials" / "textures" / "texture.png",
    )
