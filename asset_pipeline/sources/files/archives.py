"""Read the archives that data sets are published as, trusting nothing that is in them.

A tar, plain or compressed with gzip, bzip2 or xz, or a zip; told apart by content, not by name.
"""

from __future__ import annotations

import bz2
import gzip
import hashlib
import lzma
import shutil
import stat
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, cast

from manipose_mj.errors import InputError

# Far above any published scan (YCB's largest unpacks to 20 MB), far below a full disk. A tar has to be
# unpacked to be listed, so its limit holds for all that is in it; a zip's for what is taken out.
MAX_FILE_BYTES = 512 * 2**20
MAX_TOTAL_BYTES = 2 * 2**30
# The MuJoCo conversion of Google Scanned Objects, in one archive, has 36,000 files.
MAX_MEMBERS = 200_000
_CHUNK = 2**20

_BROKEN = (
    EOFError,
    zlib.error,
    gzip.BadGzipFile,
    lzma.LZMAError,
    tarfile.TarError,
    zipfile.BadZipFile,
)


@dataclass(frozen=True)
class _Entry:
    """A regular file in an archive, or a folder (`open` is None)."""

    path: PurePosixPath
    size: int
    open: Callable[[], IO[bytes]] | None


def members(archive: Path) -> list[str]:
    """The files in an archive, as paths relative to it, in its order.

    Raises:
      InputError: The archive is missing, truncated or no archive; a member's path leaves it; a member
        is a link or a device; or it is larger than the limits above.
    """
    with _readable(archive):
        return [str(entry.path) for entry in _entries(archive) if entry.open]


def hashes(archive: Path, members: Collection[str]) -> dict[str, str]:
    """The sha256 of those files in `members` that the archive holds, by path; nothing is unpacked.

    Raises:
      InputError: As `members`.
    """
    found: dict[str, str] = {}
    with _readable(archive):
        for entry in _entries(archive, members):
            if entry.open:
                digest = hashlib.sha256()
                with entry.open() as file:
                    while chunk := file.read(_CHUNK):
                        digest.update(chunk)
                found[str(entry.path)] = digest.hexdigest()
    return found


def extract(archive: Path, folder: Path, members: Collection[str] | None = None) -> list[Path]:
    """Unpack an archive into `folder`, which appears whole or, on an error, not at all.

    Only regular files and folders are accepted. Owners, modes and times are not taken over.

    Args:
      archive: The file.
      folder: Where to unpack; must not exist yet.
      members: Paths in the archive to take out; all without it.

    Returns:
      The files written, in the archive's order.

    Raises:
      InputError: As `members`; or nothing was found to unpack, or it cannot be written.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        with _readable(archive):
            written = _extract(archive, staging, members)
        staging.chmod(0o755)
        staging.rename(folder)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return [folder / relative for relative in written]


def verify(archive: Path) -> None:
    """Read an archive from end to end, so that a checksum that does not hold shows.

    Neither the limits above nor what the paths are matter here: nothing is written.

    Raises:
      InputError: The archive is missing, truncated or no archive.
    """
    with _readable(archive):
        if zipfile.is_zipfile(archive):
            with zipfile.ZipFile(archive) as file:
                if bad := file.testzip():
                    raise zipfile.BadZipFile(f"bad checksum in {bad}")
            return
        with _decompressed(archive) as stream:
            with tarfile.open(fileobj=stream, mode="r|") as tar:
                for _ in tar:
                    pass
            # The checksum of the whole comes after the last member.
            while stream.read(_CHUNK):
                pass


def _decompressed(archive: Path) -> IO[bytes]:
    with archive.open("rb") as file:
        magic = file.read(6)
    if magic.startswith(b"\x1f\x8b"):
        return cast(IO[bytes], gzip.open(archive))
    if magic.startswith(b"BZh"):
        return bz2.open(archive)
    if magic == b"\xfd7zXZ\0":
        return lzma.open(archive)
    return archive.open("rb")


@contextmanager
def _readable(archive: Path) -> Iterator[None]:
    """Turn what the readers raise on a broken archive into one line."""
    try:
        yield
    except FileNotFoundError:
        raise InputError(f"{archive}: no such file; expected an archive") from None
    except _BROKEN as error:
        reason = (str(error).splitlines() or [""])[0] or type(error).__name__
        raise InputError(
            f"{archive}: truncated, or not a zip or (gzipped tar, xz tar) archive ({reason}); "
            "download it again"
        ) from None
    except (OSError, RuntimeError, NotImplementedError) as error:
        # bzip2 says OSError of bad data; zipfile RuntimeError of a password.
        raise InputError(f"{archive}: cannot be unpacked ({error})") from None


def _entries(archive: Path, members: Collection[str] | None = None) -> Iterator[_Entry]:
    """The members, each checked, of those in `members`; each has to be read before the next."""
    reader = _zip_entries if zipfile.is_zipfile(archive) else _tar_entries
    left = None if members is None else set(members)
    total = 0
    for count, entry in enumerate(reader(archive), start=1):
        taken = left is None or str(entry.path) in left
        # Sizes are checked header by header: reading on to a tar's next header unpacks this member.
        total += entry.size if taken or reader is _tar_entries else 0
        if entry.size > MAX_FILE_BYTES or total > MAX_TOTAL_BYTES or count > MAX_MEMBERS:
            raise InputError(
                f"{archive}: too large to unpack at member {str(entry.path)!r}; the limits are "
                f"{MAX_FILE_BYTES >> 20} MiB a file, {MAX_TOTAL_BYTES >> 30} GiB and {MAX_MEMBERS} "
                "members in all; unpack it yourself and give the folder"
            )
        if not taken:
            continue
        yield entry
        if left is not None:
            left.discard(str(entry.path))
            if not left:
                return


def _tar_entries(archive: Path) -> Iterator[_Entry]:
    with tarfile.open(archive, "r:*") as tar:
        for member in tar:
            kind = "link" if member.issym() or member.islnk() else "device"
            path = _inside(archive, member.name, None if member.isreg() or member.isdir() else kind)

            def reader(member: tarfile.TarInfo = member) -> IO[bytes]:
                file = tar.extractfile(member)
                assert file is not None
                return file

            yield _Entry(path, member.size, reader if member.isreg() else None)
        # The checksum of the whole comes after the last member.
        while tar.fileobj is not None and tar.fileobj.read(_CHUNK):
            pass


def _zip_entries(archive: Path) -> Iterator[_Entry]:
    with zipfile.ZipFile(archive) as file:
        for info in file.infolist():
            mode = info.external_attr >> 16
            # Zips made on Windows state no file type.
            usual = stat.S_ISREG(mode) or stat.S_ISDIR(mode) or stat.S_IFMT(mode) == 0
            kind = "link" if stat.S_ISLNK(mode) else "device"
            path = _inside(archive, info.filename, None if usual else kind)

            def reader(info: zipfile.ZipInfo = info) -> IO[bytes]:
                return file.open(info)

            yield _Entry(path, info.file_size, None if info.is_dir() else reader)


def _extract(archive: Path, staging: Path, members: Collection[str] | None) -> list[PurePosixPath]:
    written: list[PurePosixPath] = []
    for entry in _entries(archive, members):
        target = staging / entry.path
        if entry.open is None:
            target.mkdir(parents=True, exist_ok=True)
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with entry.open() as source, target.open("wb") as sink:
            shutil.copyfileobj(source, sink)
        if target.stat().st_size != entry.size:
            raise InputError(f"{archive}: truncated in {str(entry.path)!r}; download it again")
        written.append(entry.path)
    if not written:
        expected = "a scan" if members is None else " or ".join(sorted(members))
        raise InputError(f"{archive}: holds no file to unpack; expected {expected}")
    return written


def _inside(archive: Path, name: str, kind: str | None) -> PurePosixPath:
    """The member's path, known to stay below the folder it is unpacked into."""
    if kind is not None:
        raise InputError(f"{archive}: member {name!r} is a {kind}; expected files and folders only")
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or "\0" in name:
        raise InputError(
            f"{archive}: member {name!r} leaves the folder it is unpacked into; "
            "expected relative paths without '..'"
        )
    return path
