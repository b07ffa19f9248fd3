"""Files of the clouds' cache, which any number of processes write at the same time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from manipose_mj.errors import InputError
from manipose_mj.storage.cache_root import CACHE_VARIABLE
from manipose_mj.storage.staging import staging


@contextmanager
def new_cache_file(path: Path) -> Iterator[Path]:
    """Where to write a file, which is moved to `path` at once when it is whole.

    Raises:
      InputError: `path` is a folder, or cannot be written.
    """
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder; expected the name of a file to write")
        path.parent.mkdir(parents=True, exist_ok=True)
        with staging(path) as scratch:
            yield scratch / path.name
            os.replace(scratch / path.name, path)
    except OSError as error:
        raise InputError(
            f"cannot write {path}: {error.strerror or error}; choose a folder with room that can be "
            f"written, for caches by {CACHE_VARIABLE}"
        ) from None
