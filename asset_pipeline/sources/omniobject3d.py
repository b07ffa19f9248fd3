"""OmniObject3D's raw scans: `raw_scans/<category>/<category>_NNN/Scan/Scan.obj`, with `Scan.jpg`.

Layout: https://github.com/omniobject3d/OmniObject3D, README. Units are millimetres: so the authors say in
issue 2 there. Which axis is up is stated nowhere. We take y: the authors' renderer imports the files with
Blender's default (y of the file becomes Blender's z, issue 33) and then moves its camera around z as if
that were up. It holds as far as the scans of a category are aligned, which issue 6 reports of most; a label
of a scan that lies otherwise has to be corrected. No mass is published. CC BY 4.0; Wu et al., CVPR 2023.
"""

from __future__ import annotations

import re
from contextlib import AbstractContextManager
from pathlib import Path, PurePosixPath

from asset_pipeline.sources import collection
from asset_pipeline.sources.categories import kind_of
from asset_pipeline.sources.scan import Scan, ScanItem

SOURCE = "OmniObject3D, raw scans"
LICENCE = "CC BY 4.0"
UNIT = 0.001  # [m]
_SCAN = "Scan/Scan.obj"
# From one object up to the whole data set; the published archive of a category holds its objects.
MESHES = (_SCAN, f"*/{_SCAN}", f"*/*/{_SCAN}", f"raw_scans/*/*/{_SCAN}", f"*/raw_scans/*/*/{_SCAN}")


def items(path: Path) -> list[ScanItem]:
    """The objects at `path`: the data set, a category or an object, as folder or archive.

    Raises:
      InputError: `path` does not exist or holds no such object.
    """
    return collection.find_items(Path(path), what=SOURCE, meshes=MESHES, name=_name)


def inputs(item: ScanItem) -> dict[str, str]:
    """The sha256 of every file that the object is built from, keyed by file name.

    Raises:
      InputError: The object cannot be read.
    """
    return collection.hashes(item, _files(item))


def opened(item: ScanItem) -> AbstractContextManager[Scan]:
    """Read one object, millimetres made metres; its texture stays there as long as the context does.

    Raises:
      InputError: The archive or the mesh in it cannot be used.
    """
    return collection.opened_scan(
        item,
        _files(item),
        kind=kind_of(re.sub(r"_\d+$", "", item.name)),
        up=(0.0, 1.0, 0.0),
        unit=UNIT,
        source=SOURCE,
        licence=LICENCE,
    )


def _name(root: Path, mesh: PurePosixPath) -> str:
    return collection.folder_name(root, mesh.parent.parent)


def _files(item: ScanItem) -> tuple[PurePosixPath, ...]:
    mesh = PurePosixPath(item.member)
    return mesh, mesh.with_suffix(".jpg")
