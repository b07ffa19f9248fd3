"""Unpack the archives that data sets are published as, trusting nothing that is in them."""

from __future__ import annotations

import gzip
import shutil
import tarfile
import tempfile
import zlib
from pathlib import Path, PurePosixPath

from manipose_mj.errors import InputError

# Far above any published scan (YCB's largest unpacks to 20 MB), far below a full disk.
MAX_FILE_BYTES = 512 * 2**20
MAX_TOTAL_BYTES = 2 * 2**30
MAX_MEMBERS = 10_000


def extract_tgz(archive: Path, folder: Path) -> list[Path]:
    """Unpack a gzipped tar into `folder`, which appears whole or, on an error, not at all.

    Only regular files and folders are accepted. Owners, modes and times are not taken over.

    Args:
      archive: The `.tgz` file.
      folder: Where to unpack; must not exist yet.

    Returns:
      The files written, in the archive's order.

    Raises:
      InputError: The archive is missing, truncated or no archive; a member's path leaves the
        folder; a member is a link or a device; or it holds more than 2 GiB or 10,000 files.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        written = _extract(archive, staging)
        staging.chmod(0o755)
        staging.rename(folder)
    except (EOFError, zlib.error, gzip.BadGzipFile, tarfile.TarError) as error:
        reason = str(error) or type(error).__name__
        raise InputError(
            f"{archive}: truncated or not a gzipped tar ({reason}); download it again"
        ) from None
    except FileNotFoundError:
        raise InputError(f"{archive}: no such file; expected a .tgz archive") from None
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return [folder / relative for relative in written]


def _extract(archive: Path, staging: Path) -> list[PurePosixPath]:
    written: list[PurePosixPath] = []
    total = 0
    with tarfile.open(archive, "r:gz") as tar:
        # Sizes are checked header by header: reading on to the next header unpacks this member.
        for count, member in enumerate(tar, start=1):
            relative = _inside(archive, member)
            total += member.size
            if member.size > MAX_FILE_BYTES or total > MAX_TOTAL_BYTES or count > MAX_MEMBERS:
                raise InputError(
                    f"{archive}: too large to unpack at member {member.name!r}; the limits are "
                    f"{MAX_FILE_BYTES >> 20} MiB a file, {MAX_TOTAL_BYTES >> 30} GiB and "
                    f"{MAX_MEMBERS} members in all"
                )
            target = staging / relative
            if member.isdir():
                target.mkdir(parents=True, exist_ok=True)
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            source = tar.extractfile(member)
            assert source is not None
            with source, target.open("wb") as sink:
                shutil.copyfileobj(source, sink)
            if target.stat().st_size != member.size:
                raise InputError(f"{archive}: truncated in {member.name!r}; download it again")
            written.append(relative)
    if not written:
        raise InputError(f"{archive}: holds no file; expected a scan")
    return written


def _inside(archive: Path, member: tarfile.TarInfo) -> PurePosixPath:
    """The member's path, known to stay below the folder it is unpacked into."""
    if not (member.isreg() or member.isdir()):
        kind = "link" if member.issym() or member.islnk() else "device"
        raise InputError(
            f"{archive}: member {member.name!r} is a {kind}; expected files and folders only"
        )
    path = PurePosixPath(member.name)
    if path.is_absolute() or ".." in path.parts or "\\" in member.name or "\0" in member.name:
        raise InputError(
            f"{archive}: member {member.name!r} leaves the folder it is unpacked into; "
            "expected relative paths without '..'"
        )
    return path
