"""The texture that a PLY file names in its header, as MeshLab writes it and BOP's data sets have it."""

from __future__ import annotations

import logging
import re

from asset_pipeline.sources.files.ply_rows import PlyHeader
from asset_pipeline.sources.files.references import leaves

log = logging.getLogger(__name__)


def texture_name(header: PlyHeader, where: str) -> str | None:
    """The file name after `comment TextureFile`, without any folder; None if the header has none.

    Args:
      header: Of the PLY file.
      where: Opens the warning about a name that leaves the folder.
    """
    for line in header.comments:
        words = line.split(maxsplit=2)
        if words[:2] == ["comment", "TextureFile"] and len(words) == 3:
            name = words[2].strip()
            if leaves(name):
                log.warning("%s: it names %r, outside its folder, which is not opened", where, name)
            return re.split(r"[/\\]", name)[-1]
    return None
