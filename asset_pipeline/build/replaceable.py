"""Whether a folder may be replaced by an asset: a build removes what is there, and must not remove a person's files."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Sequence
from pathlib import Path

from manipose_mj.assets.asset import ASSET_FILE, Asset
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.errors import InputError

# Folders and files are named for it, with up to 30 characters more; file systems take 255 bytes.
MOST_BYTES = 200
# In an asset's inputs: a digest of where the file lies, seen from the folder of assets, so that both may move together.
PLACE = "place"


def check_replaceable(folder: Path, sources: Sequence[Path] = ()) -> None:
    """Refuse to build an asset where it would replace anything but an asset.

    Args:
      folder: Where the asset folder is to be.
      sources: The files that it is built from.

    Raises:
      InputError: `folder` is a file, a folder that is neither empty nor an asset, or holds one of `sources`; or its
        name is too long.
    """
    if len(os.fsencode(folder.name)) > MOST_BYTES:
        raise InputError(
            f"{folder.name[:20]}...: a name of {len(os.fsencode(folder.name))} bytes; "
            f"expected at most {MOST_BYTES}, so rename it"
        )
    if not folder.is_dir():
        if folder.exists():
            raise InputError(
                f"{folder}: is a file, where the asset's folder would be; move it, or name another --out"
            )
        return
    for file in sources:
        if _holds(folder, file):
            raise InputError(
                f"{folder}: holds {file}, which the asset would replace; name another --out"
            )
    if not (folder / ASSET_FILE).is_file() and any(folder.iterdir()):
        raise InputError(
            f"{folder}: is no asset (it has no {ASSET_FILE}) and would be replaced; "
            "move it, or name another --out"
        )


def place(file: Path, folder: Path) -> str:
    """What an asset's inputs say of where its file lies: two files of one name differ in it.

    Args:
      file: What the asset is built from.
      folder: The asset's.
    """
    path = _location(file)
    with contextlib.suppress(ValueError):  # on another drive
        path = Path(os.path.relpath(path, folder.parent.resolve()))
    return hashlib.sha256(path.as_posix().encode("utf-8", "surrogateescape")).hexdigest()[:16]


def check_source(folder: Path, source: str) -> None:
    """Refuse to replace an asset by that of another source which has the same name.

    Args:
      folder: Where the asset is to be.
      source: What the provenance of such assets says.

    Raises:
      InputError: The asset that is there came from another source.
    """
    try:
        provenance = read_asset(folder).provenance
    except InputError:
        return
    if provenance.source != source:
        raise InputError(
            f"{folder}: was built from another source, {provenance.item} of {provenance.source}; "
            f"expected an asset of {source}, so name another --out, or remove that asset"
        )


def check_origin(folder: Path, file: Path, source: str, inputs: dict[str, str]) -> None:
    """Refuse to replace an asset by that of another file which has the same name.

    A file that has changed where it was, or is the same elsewhere, is no other file. Assets that do not say where
    their file lay are taken to be of this one.

    Args:
      folder: Where the asset is to be.
      file: What it is built from.
      source: What the provenance of such assets says.
      inputs: Hashes by file name.

    Raises:
      InputError: The asset that is there was built from another file.
    """
    try:
        asset = read_asset(folder)
    except InputError:
        return
    if (other := _other_origin(asset, file, source, inputs)) is not None:
        raise InputError(
            f"{file}: {folder} was built from another file, {other}; "
            "rename one, name another --out, or remove that asset"
        )


def _other_origin(asset: Asset, file: Path, source: str, inputs: dict[str, str]) -> str | None:
    """What the asset was built from, where that is another file."""
    provenance = asset.provenance
    if provenance.source != source:
        return f"{provenance.item} of {provenance.source}"
    before = Path(provenance.item).name
    known, here = provenance.inputs.get(before), place(file, asset.folder)
    if provenance.inputs.get(PLACE, here) == here or known == inputs[file.name]:
        return None
    return f"a {before} elsewhere with sha256 {known and known[:12]}"


def _holds(folder: Path, file: Path) -> bool:
    """Whether a file lies in a folder, itself or what it links to."""
    inside = folder.resolve()
    return any(path.is_relative_to(inside) for path in (_location(file), file.resolve()))


def _location(file: Path) -> Path:
    """Where the file lies, not what it links to."""
    return file.parent.resolve() / file.name
