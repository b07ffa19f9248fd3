"""Build a folder or a file aside, and put it where it belongs by one rename."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

PREFIX = ".building-"
LOCK = f"{PREFIX}lock"  # beside what is built, so by no name that it may have


@contextmanager
def staging(folder: Path) -> Iterator[Path]:
    """A new folder beside `folder`, removed in the end; if the process is killed, by `clear_staging`.

    Raises:
      OSError: It cannot be made.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    path = Path(tempfile.mkdtemp(prefix=f"{PREFIX}{folder.name}-", dir=folder.parent))
    try:
        # The lock goes with the process, however it ends.
        with (path / LOCK).open("wb") as lock:
            _locked(lock)
            yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A scratch path that takes the place of the file `path` at once when all went well.

    Raises:
      OSError: It cannot be written.
    """
    with staging(path) as folder:
        scratch = folder / path.name
        yield scratch
        os.replace(scratch, path)


@contextmanager
def made_for_result(folder: Path) -> Iterator[None]:
    """Make a folder and those above it; where no result follows, what is new and empty of them goes again.

    Raises:
      OSError: It cannot be made.
    """
    new = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for each in new:
            with contextlib.suppress(OSError):  # something is in it
                each.rmdir()


def clear_staging(parent: Path) -> None:
    """Remove what `staging` made in `parent` for processes that were killed since."""
    for path in parent.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError), (path / LOCK).open("r+b") as lock:
            if _locked(lock):
                shutil.rmtree(path, ignore_errors=True)


def put_in_place(built: Path, folder: Path) -> None:
    """Make `built` the folder `folder`; another process may be doing the same with equal content.

    Raises:
      OSError: It cannot be moved.
    """
    while True:
        try:
            os.rename(built, folder)
            return
        except OSError:
            if not folder.is_dir():
                raise
            retired = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=built.parent))
            with contextlib.suppress(FileNotFoundError):
                os.rename(folder, retired / "old")
            shutil.rmtree(retired, ignore_errors=True)


def _locked(file: IO[bytes]) -> bool:
    """Whether the lock is now ours; not where the system or the disk has none."""
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (ImportError, OSError):
        return False
    return True
