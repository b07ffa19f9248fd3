"""Piles at rest, kept in the catalogue's cache: dropping one takes a second or a few, once."""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
import zipfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import mujoco
import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.storage.cache_root import cache_root
from manipose_mj.storage.source_hash import source_hash
from manipose_mj.tasks.clutter.pile import Pile, PileConfig, settle

log = logging.getLogger(__name__)


class PileCache:
    """The piles of one set of assets and one configuration, numbered from 0.

    Pile `k` is the same, bit for bit, whether it is dropped now, was dropped by another process or comes
    from the disk; no other pile has a part in it. A pile that is not there yet is dropped when it is
    asked for: the first episode that uses it starts a few seconds late.
    """

    def __init__(self, assets: Sequence[Asset], config: PileConfig) -> None:
        self._assets = tuple(assets)
        self._config = config
        self._folder = cache_root() / "piles" / _key(self._assets, config)
        self._piles: dict[int, Pile] = {}

    def pile(self, number: int) -> Pile:
        """One of them.

        Raises:
          InputError: No pile of these assets comes to rest.
        """
        if number not in self._piles:
            self._piles[number] = self._read(number) or self._drop(number)
        return self._piles[number]

    def _path(self, number: int) -> Path:
        return self._folder / f"{number:03d}.npz"

    def _read(self, number: int) -> Pile | None:
        try:
            with np.load(self._path(number), allow_pickle=False) as stored:
                return Pile(**{name: stored[name] for name in Pile.__dataclass_fields__})
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
            log.warning("dropping a pile anew: %s is damaged (%s)", self._path(number), error)
            return None

    def _drop(self, number: int) -> Pile:
        pile = settle(self._assets, self._config, number)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            # Written aside and renamed: others may be reading, or writing the same.
            handle, scratch = tempfile.mkstemp(suffix=".npz", dir=self._folder)
            with os.fdopen(handle, "wb") as file:
                np.savez(file, **vars(pile))
            os.replace(scratch, self._path(number))
        except OSError as error:
            log.warning("piles are not kept: cannot write %s (%s)", self._folder, error)
        return pile


def _key(assets: Sequence[Asset], config: PileConfig) -> str:
    """Changes with anything that a pile depends on."""
    digest = hashlib.sha256(repr(config).encode())
    for asset in assets:
        for path in sorted(p for p in asset.folder.rglob("*") if p.is_file()):
            digest.update(path.relative_to(asset.folder).as_posix().encode() + b"\0")
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    libraries = [mujoco.__version__, np.__version__, version("scipy")]
    return f"{source_hash((Pile.__module__,), *libraries)}-{digest.hexdigest()[:12]}"
