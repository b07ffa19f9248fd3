"""Build a folder aside, and put it where it belongs by one rename."""

from __future__ import annotations

import contextlib
import glob
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

PREFIX = ".building-"
LOCK = "lock"


@contextmanager
def staging(folder: Path) -> Iterator[Path]:
    """A new folder beside `folder`, removed in the end; also those that killed processes left there.

    Raises:
      OSError: It cannot be made.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    prefix = f"{PREFIX}{folder.name}-"
    for left in folder.parent.glob(f"{glob.escape(prefix)}*"):
        _remove_if_left(left)
    path = Path(tempfile.mkdtemp(prefix=prefix, dir=folder.parent))
    try:
        # The lock goes with the process, however it ends.
        with (path / LOCK).open("wb") as lock:
            _locked(lock)
            yield path
    finally:
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


def _remove_if_left(path: Path) -> None:
    with contextlib.suppress(OSError), (path / LOCK).open("ab") as lock:
        if _locked(lock):
            shutil.rmtree(path, ignore_errors=True)


def _locked(file: IO[bytes]) -> bool:
    """Whether the lock is now ours; not where the system or the disk has none."""
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (ImportError, OSError):
        return False
    return True
