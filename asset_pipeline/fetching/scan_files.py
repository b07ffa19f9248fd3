"""Fetch a data set's files into a folder, with a list of what came from where, so that a later run can tell."""

from __future__ import annotations

import json
import logging
import re
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal
from urllib.parse import quote

from asset_pipeline.fetching.download import (
    USER_AGENT,
    DownloadSettings,
    NotPublishedError,
    UnreachableError,
    download,
)
from asset_pipeline.fetching.fetch_record import RECORD, FetchRecord
from asset_pipeline.fetching.publishers import PUBLISHERS, Publisher
from manipose_mj.errors import InputError, unknown_name

log = logging.getLogger(__name__)

# A name becomes a file name and a part of an address; servers' lists are not trusted to be names.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._()&',+-]{0,150}")
MAX_INDEX_PAGES = 100
MAX_INDEX_BYTES = 16 * 2**20


@dataclass(frozen=True)
class FetchResult:
    """What became of one object's file.

    Attributes:
      name: The object.
      status: `"fetched"`, `"present"` (there already, and as it was when it came), `"absent"` (the
        publisher has no such file) or `"failed"`.
      path: The file.
      reason: One line, when it failed.
    """

    name: str
    status: Literal["fetched", "present", "absent", "failed"]
    path: Path
    reason: str = ""


@dataclass(frozen=True)
class Position:
    """Where a fetch is: which file of how many, and its bytes (`total` None: not announced)."""

    name: str
    number: int
    count: int
    done: int
    total: int | None


def fetch(
    source: str,
    out: Path,
    *,
    only: Sequence[str] = (),
    mirror: str | None = None,
    checksums: Path | None = None,
    progress: Callable[[Position], None] | None = None,
    settings: DownloadSettings | None = None,
) -> list[FetchResult]:
    """Download a data set's archives into `out`; what is there already is only checked.

    Beside them `fetched.json` says of each file its address, size and sha256.

    Args:
      source: A key of `PUBLISHERS`.
      out: Folder for the files; made if it is not there.
      only: Names of the objects; all without it, those that the publisher lacks left out.
      mirror: Address that stands in for the publisher's `base`.
      checksums: File of lines as `sha256sum` prints them, which the files must match.
      progress: Called as the bytes come.
      settings: Patience with the server.

    Returns:
      One result an object, sorted by name; one failure does not stop the others.

    Raises:
      InputError: The source is unknown or not free to download, a name is none of its objects, the list
        of objects or the checksums cannot be read, `out` cannot be written, or the server not reached.
    """
    if source not in PUBLISHERS:
        raise unknown_name("data set", source, PUBLISHERS)
    publisher = PUBLISHERS[source]
    if not publisher.base:
        raise InputError(
            f"{source} may not be downloaded unasked; see {publisher.homepage}, and "
            f"`manipose assets fetch {source}` for the steps"
        )
    base = (mirror or publisher.base).rstrip("/")
    expected = {} if checksums is None else read_checksums(checksums)
    names = _names(publisher, base, only, settings or DownloadSettings())
    try:
        out.mkdir(parents=True, exist_ok=True)
        record = FetchRecord(out / RECORD, source, publisher)
        record.write()
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror})") from None
    results = []
    for number, name in enumerate(names, start=1):

        def show(done: int, total: int | None, /, name: str = name, number: int = number) -> None:
            if progress is not None:
                progress(Position(name, number, len(names), done, total))

        path = out / publisher.file.format(name=name)
        url = f"{base}/{quote(path.name)}"
        digest = expected.get(path.name)
        try:
            if path.exists():
                record.check(path, url, digest)
                results.append(FetchResult(name, "present", path))
            else:
                got = download(url, path, digest=digest, progress=show, settings=settings)
                record.add(path, url, got)
                results.append(FetchResult(name, "fetched", path))
        except UnreachableError:
            raise
        except NotPublishedError as error:
            status = "failed" if name in only else "absent"
            results.append(FetchResult(name, status, path, str(error)))
        except InputError as error:
            results.append(FetchResult(name, "failed", path, str(error)))
    return results


def read_checksums(path: Path) -> dict[str, str]:
    """The sha256 of each file name in a file of `sha256sum`'s form.

    Raises:
      InputError: The file cannot be read or a line is none of these.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    found = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        match = re.fullmatch(r"([0-9a-fA-F]{64}) [ *](?:.*/)?([^/]+)", line)
        if match is None:
            raise InputError(
                f"{path}: line {number}: expected '<sha256>  <file>', got {line[:80]!r}"
            )
        found[match[2]] = match[1].lower()
    return found


def _names(
    publisher: Publisher, base: str, only: Sequence[str], settings: DownloadSettings
) -> list[str]:
    if only:
        for name in only:
            if publisher.names and name not in publisher.names:
                raise unknown_name(f"object of {publisher.title}", name, publisher.names)
            _require_name(name, "--only")
        return sorted(set(only))
    if publisher.names:
        return sorted(publisher.names)
    found: set[str] = set()
    for page in range(1, MAX_INDEX_PAGES + 1):
        url = base + publisher.index.format(page=page)
        try:
            entries = _index_page(url, settings)
        except NotPublishedError:
            if page == 1:
                raise
            break  # how some servers say that the list ends
        new = {_require_name(entry["name"], url) for entry in entries} - found
        if not new:
            break
        found |= new
    if not found:
        raise InputError(f"{base}: lists no objects; expected JSON objects with a name")
    return sorted(found)


def _index_page(url: str, settings: DownloadSettings) -> Sequence[Mapping[str, Any]]:
    request = urllib.request.Request(url, headers={"User-Agent": USER_AGENT})
    try:
        with urllib.request.urlopen(request, timeout=settings.timeout) as answer:
            entries = json.loads(answer.read(MAX_INDEX_BYTES))
    except urllib.error.HTTPError as error:
        error.close()
        kind = NotPublishedError if error.code == 404 else InputError
        raise kind(f"{url}: HTTP {error.code}; expected the list of objects") from None
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{url}: the list of objects cannot be read ({error})") from None
    if not isinstance(entries, list) or not all(
        isinstance(e, dict) and isinstance(e.get("name"), str) for e in entries
    ):
        raise InputError(f"{url}: expected a JSON list of objects with a name")
    return entries


def _require_name(name: str, where: str) -> str:
    if not _NAME.fullmatch(name):
        raise InputError(
            f"{where}: {name[:80]!r} is no name of an object; expected letters, digits"
        )
    return name
