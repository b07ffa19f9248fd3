"""Assets that a protocol is about and users build themselves: scans whose licences keep them out of this package."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from manipose_mj.assets.asset import ASSET_FILE
from manipose_mj.assets.categories import is_known
from manipose_mj.assets.json_fields import read_json
from manipose_mj.errors import InputError
from manipose_mj.evaluation.protocol.frozen import VERSIONS, Protocol, load

# How the provenance of an asset begins that `manipose assets build SOURCE` made of a data set.
PROVENANCE = {
    "ycb": "YCB",
    "google_scanned_objects": "Google Scanned Objects",
    "partnet_mobility": "PartNet-Mobility",
}
_CATALOGUE = (
    "procedural catalogue"  # the provenance of objects that the catalogue's generators made
)
_DEPTH = 2  # of folders in a folder that are looked into


@dataclass(frozen=True)
class BuiltAsset:
    """An asset folder as its file states it. Attributes: folder; name; data_set: one of `PROVENANCE`, or empty;
    made: of what and by what; built_in: which of the built-in objects it is, or empty."""

    folder: Path
    name: str
    data_set: str
    made: str
    built_in: str = ""


def built_assets(folders: Sequence[str | Path]) -> list[BuiltAsset]:
    """What is in some folders: asset folders, folders of them, or folders of such folders.

    Raises:
      InputError: There is no such folder, or an asset's file cannot be read.
    """
    found = []
    for folder in map(Path, folders):
        if not folder.is_dir():
            what = "is a file; expected a" if folder.is_file() else "no such"
            raise InputError(f"{folder}: {what} folder of assets")
        patterns = ["/".join(["*"] * depth + [ASSET_FILE]) for depth in range(_DEPTH + 1)]
        files = [path for pattern in patterns for path in sorted(folder.glob(pattern))]
        found += [_stated(path) for path in files]
    return found


def _stated(path: Path) -> BuiltAsset:
    document = read_json(path).values
    provenance = document.get("provenance") or {}
    source = str(provenance.get("source", ""))
    data_set = next((name for name, start in PROVENANCE.items() if source.startswith(start)), "")
    made = json.dumps([provenance.get("inputs"), provenance.get("generator")], sort_keys=True)
    item = str(provenance.get("item"))
    built_in = item if source == _CATALOGUE and is_known(item) else ""
    return BuiltAsset(path.parent, str(document.get("name")), data_set, made, built_in)


def version_with(asset: BuiltAsset) -> str | None:
    """The first protocol whose users build this object for it; None where none has it."""
    for version in VERSIONS:
        sources = load(version).sources
        if asset.data_set and sources.get(asset.name) == asset.data_set:
            return version
    return None


def needed(protocol: Protocol, tasks: Iterable[str]) -> tuple[str, ...]:
    """Names of the assets that the episodes of some tasks are drawn from, sorted; none where all are built in."""
    return tuple(sorted({name for task in tasks for name in protocol.task(task).pool}))


def find_assets(
    version: str, tasks: Iterable[str], folders: Iterable[str | Path]
) -> dict[str, BuiltAsset]:
    """What the user has built of what a protocol needs, by name.

    Raises:
      InputError: Some of it is missing; one line that names all of that, and says how to get it. Or two assets
        are the same object.
    """
    return dict(_found(version, tuple(sorted(tasks)), tuple(map(str, folders))))


def pool_folders(version: str, task: str, folders: Iterable[str | Path]) -> tuple[str, ...] | None:
    """The asset folders that a task's episodes are drawn from, in the protocol's order; None: built-in objects.

    Raises:
      InputError: As `find_assets`.
    """
    pool = load(version).task(task).pool
    if not pool:
        return None
    found = find_assets(version, (task,), folders)
    return tuple(str(found[name].folder) for name in pool)


@lru_cache(maxsize=64)
def _found(
    version: str, tasks: tuple[str, ...], folders: tuple[str, ...]
) -> tuple[tuple[str, BuiltAsset], ...]:
    protocol = load(version)
    present: dict[tuple[str, str], BuiltAsset] = {}
    for asset in built_assets(folders):
        key = asset.data_set, asset.name
        if key in present and asset.data_set:
            raise InputError(
                f"{asset.folder}: the same object as {present[key].folder}; name one of the folders only"
            )
        present[key] = asset
    names = needed(protocol, tasks)
    missing = [name for name in names if (protocol.sources[name], name) not in present]
    if missing:
        raise InputError(_how_to_get(protocol, missing, len(names), folders))
    return tuple((name, present[protocol.sources[name], name]) for name in names)


def _how_to_get(
    protocol: Protocol, missing: Sequence[str], count: int, folders: Sequence[str]
) -> str:
    by_set: dict[str, list[str]] = {}
    for name in missing:
        by_set.setdefault(protocol.sources[name], []).append(name)
    where = f"--assets {' '.join(folders)}" if folders else "--assets, which is not given,"
    commands = " and ".join(
        f"`manipose assets build {data_set} PATH --out DIR --only {' '.join(names)}`"
        for data_set, names in by_set.items()
    )
    return (
        f"protocol {protocol.version}: {where} lacks {len(missing)} of {count} objects; `manipose assets fetch SOURCE` "
        f"gets a data set or says where it is to be had, then {commands}"
    )


def digest_of_objects(objects: Iterable[str] | None) -> str | None:
    """`digest_of` of the asset folders among what an environment draws from; None where all are built in."""
    from manipose_mj.tasks.core.object_selection import is_folder  # loads the simulator

    folders = [each for each in objects or () if is_folder(each)]
    return digest_of(built_assets(folders)) if folders else None


def digest_of(assets: Iterable[BuiltAsset]) -> str:
    """The sha256 of what assets were made of and by what: results of other ones do not belong together."""
    stated = sorted([asset.data_set, asset.name, asset.made] for asset in assets)
    return hashlib.sha256(json.dumps(stated).encode("utf-8")).hexdigest()
