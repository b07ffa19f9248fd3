"""Download one file over HTTP so that nothing half done ever bears its name.

The bytes go into `<name>.part`, and what identifies the server's version of the file (`ETag`,
`Last-Modified`, length) into `<name>.part.json`; a later call asks for the rest with `Range` and `If-Range`
(RFC 9110, 13.1.5 and 14.2) and starts again where the server's file is another one by then.
"""

from __future__ import annotations

import http.client
import json
import logging
import os
import shutil
import socket
import ssl
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlsplit

from asset_pipeline.sources.files.archives import verify
from asset_pipeline.sources.scan import sha256
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

CHUNK = 2**18
USER_AGENT = "manipose-mj (asset fetch)"


@dataclass(frozen=True)
class DownloadSettings:
    """How patient a download is.

    Attributes:
      timeout: Without a byte, after which a connection counts as cut [s].
      attempts: Connections in a row that bring no byte before it gives up.
      pause: Before the second of them; doubles with each [s].
    """

    timeout: float = 30.0
    attempts: int = 4
    pause: float = 1.0


@dataclass(frozen=True)
class Version:
    """What tells one version of a server's file from another."""

    etag: str = ""
    modified: str = ""
    size: int | None = None

    @property
    def condition(self) -> str:
        """The value of `If-Range`; weak tags may not stand there."""
        return self.modified if self.etag.startswith("W/") or not self.etag else self.etag


class Progress(Protocol):
    """Called with the bytes that are there and those expected (None where the server does not say)."""

    def __call__(self, done: int, total: int | None, /) -> None:
        """Take note of both."""
        ...


class NotPublishedError(InputError):
    """The server has no such file (404 or 410)."""


class UnreachableError(InputError):
    """No server answers at the address, so that asking it for another file is no use."""


def download(
    url: str,
    target: Path,
    *,
    digest: str | None = None,
    progress: Progress | None = None,
    settings: DownloadSettings | None = None,
) -> str:
    """Fetch an archive into `target`, going on where an earlier call was interrupted.

    `target` appears only when all bytes are there, the archive's own checksums hold and so does `digest`.

    Args:
      url: Where it is; http or https.
      target: The file to write; its folder must exist.
      digest: The sha256 it must have, in hex.
      progress: Called as the bytes come.
      settings: Patience.

    Returns:
      The file's sha256.

    Raises:
      NotPublishedError: The server has no such file.
      UnreachableError: There is no server.
      InputError: It cannot be read, what came is not the file, or the disk is full.
    """
    settings = settings or DownloadSettings()
    if urlsplit(url).scheme not in ("http", "https"):
        raise InputError(f"{url}: expected an http or https address")
    part = target.with_name(target.name + ".part")
    note = target.with_name(target.name + ".part.json")
    _receive(url, part, note, progress or (lambda done, total, /: None), settings)
    got = sha256(part)
    _accept(part, note, url, digest, got)
    with _writing(target):
        os.replace(part, target)
        note.unlink(missing_ok=True)
    return got


def _accept(part: Path, note: Path, url: str, digest: str | None, got: str) -> None:
    """Refuse, and forget, a complete file that is not what was asked for: resuming would not mend it."""
    try:
        if digest is not None and got != digest.lower():
            raise InputError(f"{url}: sha256 is {got}, expected {digest}; the file was not kept")
        try:
            verify(part)
        except InputError as error:
            reason = str(error).removeprefix(f"{part}: ")
            raise InputError(f"{url}: {reason}") from None
    except InputError:
        part.unlink(missing_ok=True)
        note.unlink(missing_ok=True)
        raise


def _receive(
    url: str, part: Path, note: Path, progress: Progress, settings: DownloadSettings
) -> None:
    """Fill `part`, reconnecting as long as that brings bytes."""
    fruitless, reason = 0, ""
    while fruitless < settings.attempts:
        if fruitless:
            time.sleep(settings.pause * 2 ** (fruitless - 1))
        before = _size(part)
        try:
            if _connect(url, part, note, progress, settings):
                return
            reason = "the connection was cut"
        except urllib.error.HTTPError as error:
            error.close()
            if error.code in (404, 410):
                raise NotPublishedError(f"{url}: not there (HTTP {error.code})") from None
            reason = f"HTTP {error.code} {error.reason}"
            if error.code == 416:  # what is there is no beginning of what the server has now
                part.unlink(missing_ok=True)
            elif error.code < 500 and error.code not in (408, 429):
                raise InputError(f"{url}: refused ({reason})") from None
        except urllib.error.URLError as error:
            reason = str(error.reason)
            fatal = isinstance(error.reason, (ssl.SSLCertVerificationError, socket.gaierror))
            if fatal or fruitless == settings.attempts - 1:
                raise UnreachableError(f"{url}: cannot be reached ({reason})") from None
        except (http.client.HTTPException, OSError) as error:  # what fails on disk is an InputError
            reason = str(error) or type(error).__name__
        log.info("%s: %s; %d bytes so far", url, reason, _size(part))
        fruitless = 0 if _size(part) > before else fruitless + 1
    kept = f"; {_size(part)} bytes are kept, run again to go on" if _size(part) else ""
    raise InputError(f"{url}: cannot be downloaded ({reason}){kept}")


def _connect(
    url: str, part: Path, note: Path, progress: Progress, settings: DownloadSettings
) -> bool:
    """One connection; True when the file is complete."""
    have, version = _size(part), _read_note(note)
    if not version.condition or (version.size is not None and have > version.size):
        have = 0  # nothing says that what is there belongs to what the server has
    if have and have == version.size:
        return True
    headers = {"User-Agent": USER_AGENT, "Accept-Encoding": "identity"}
    if have:
        headers |= {"Range": f"bytes={have}-", "If-Range": version.condition}
    request = urllib.request.Request(url, headers=headers)
    with urllib.request.urlopen(request, timeout=settings.timeout) as answer:
        start = _start(answer, have)
        length = answer.headers.get("Content-Length", "")
        size = start + int(length) if length.isdigit() else None
        now = Version(answer.headers.get("ETag", ""), answer.headers.get("Last-Modified", ""), size)
        if start and (now.etag, now.modified, now.size) != (
            version.etag,
            version.modified,
            version.size,
        ):
            part.unlink()  # the server ignored If-Range
            return False
        _require_room(part, None if size is None else size - start)
        with _writing(part):
            # Unbuffered, so that closing has nothing left to fail at. What belongs to another version goes
            # before the note says which version is there.
            sink = part.open("ab" if start else "wb", buffering=0)
            note.write_text(json.dumps(asdict(now)), encoding="utf-8")
        done = start
        with sink:
            while chunk := answer.read1(CHUNK):  # what is there, without waiting for more
                with _writing(part):
                    left = memoryview(chunk)
                    while left:
                        left = left[sink.write(left) :]
                done += len(chunk)
                progress(done, size)
            with _writing(part):
                os.fsync(sink.fileno())
    return size is None or done == size


def _start(answer: Any, have: int) -> int:
    """At which byte the answer begins."""
    if answer.status != 206:
        return 0
    expected = f"bytes {have}-"
    if not answer.headers.get("Content-Range", "").startswith(expected):
        raise http.client.HTTPException("the server sent another range than was asked for")
    return have


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None


def _require_room(part: Path, needed: int | None) -> None:
    free = shutil.disk_usage(part.parent).free
    if needed is not None and needed > free:
        raise InputError(
            f"{part.parent}: {needed / 1e6:.0f} MB to come, {free / 1e6:.0f} MB free; make room"
        )


def _size(part: Path) -> int:
    return part.stat().st_size if part.is_file() else 0


def _read_note(note: Path) -> Version:
    try:
        fields = json.loads(note.read_text(encoding="utf-8"))
        return Version(str(fields["etag"]), str(fields["modified"]), fields["size"])
    except (OSError, ValueError, KeyError, TypeError):
        return Version()
