"""`fetched.json`: where each file of a data set came from, and what it was when it came."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from asset_pipeline.fetching.publishers import Publisher
from asset_pipeline.sources.files.archives import verify
from asset_pipeline.sources.scan import sha256
from manipose_mj.errors import InputError

RECORD = "fetched.json"


class FetchRecord:
    """The list, read from disk where there is one already."""

    def __init__(self, path: Path, source: str, publisher: Publisher) -> None:
        """Read what was noted so far.

        Args:
          path: The file.
          source: The data set's name.
          publisher: Whose licence is noted beside the files.

        Raises:
          InputError: The file is there and is no such list.
        """
        self._path = path
        self._origin = {
            "source": source,
            "licence": publisher.licence,
            "homepage": publisher.homepage,
        }
        self._files: dict[str, dict[str, Any]] = _read_files(path)

    def add(self, path: Path, url: str, digest: str) -> None:
        """Note a file that has just come."""
        size = path.stat().st_size
        self._files[path.name] = {**self._origin, "url": url, "bytes": size, "sha256": digest}
        try:
            self.write()
        except OSError as error:
            raise InputError(f"{self._path}: cannot be written ({error.strerror})") from None

    def check(self, path: Path, url: str, digest: str | None) -> None:
        """Compare a file that is there with what was noted, or note it if nothing was.

        Raises:
          InputError: It is another file, or no whole archive.
        """
        got = sha256(path)
        noted = self._files.get(path.name, {}).get("sha256")
        for expected, where in ((digest, "the checksums say"), (noted, f"{RECORD} says")):
            if expected is not None and got != expected:
                raise InputError(
                    f"{path}: sha256 is {got}, {where} {expected}; delete it to fetch it again"
                )
        if noted is None:
            verify(path)
            self.add(path, url, got)

    def write(self) -> None:
        """Put the list on disk, whole or not at all."""
        text = json.dumps({"files": dict(sorted(self._files.items()))}, indent=1)
        part = self._path.with_name(self._path.name + ".part")
        part.write_text(text + "\n", encoding="utf-8")
        os.replace(part, self._path)


def _read_files(path: Path) -> dict[str, dict[str, Any]]:
    try:
        files = json.loads(path.read_text(encoding="utf-8"))["files"]
        return {str(k): dict(v) for k, v in files.items()}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: is no list of fetched files ({error}); delete it to have the files checked again"
        ) from None
