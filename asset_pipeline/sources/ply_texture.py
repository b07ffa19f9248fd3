"""The texture that a PLY file names in its header, as MeshLab writes it and BOP's data sets have it."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

# Far more than any header; a file without `end_header` is not read whole.
MAX_HEADER_LINES = 500


def texture_name(path: Path) -> str | None:
    """The file name after `comment TextureFile`, without any folder; None if the header has none."""
    with path.open("rb") as file:
        for _ in range(MAX_HEADER_LINES):
            line = file.readline(1000).decode("latin-1").strip()
            if not line or line == "end_header":
                return None
            words = line.split(maxsplit=2)
            if words[:2] == ["comment", "TextureFile"] and len(words) == 3:
                return PurePosixPath(words[2].strip().replace("\\", "/")).name
    return None
