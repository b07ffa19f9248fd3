"""The objects of a data set as its publisher ships it: a folder or an archive, seen the same way."""

from __future__ import annotations

import logging
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

import numpy as np
import trimesh

from asset_pipeline.sources.categories import Kind
from asset_pipeline.sources.files import archives
from asset_pipeline.sources.files.ply_rows import check_rows
from asset_pipeline.sources.files.wavefront_lines import read_lines
from asset_pipeline.sources.scan import Scan, ScanItem, load_scan_mesh, sha256
from manipose_mj.assets.asset import Provenance
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)


def find_items(
    root: Path,
    *,
    what: str,
    meshes: Sequence[str],
    name: Callable[[Path, PurePosixPath], str],
    inside: Sequence[str] = (),
) -> list[ScanItem]:
    """The objects at `root`: an archive of some, or a folder of them and of archives of them.

    An object that is there both ways is read from its folder. An archive that cannot be read becomes
    an item that fails when it is opened, so that it does not stop the others.

    Args:
      root: Folder or archive.
      what: The data set, for messages.
      meshes: Glob patterns of the mesh files, relative to the folder or archive.
      name: The object's name, from the folder or archive and the mesh's path in it.
      inside: Glob patterns of archives in the folder.

    Returns:
      Items sorted by name; `member` is the mesh's path.

    Raises:
      InputError: `root` does not exist, is no archive or holds none.
    """
    expected = ", ".join((*meshes, *inside))
    if not root.exists():
        raise InputError(f"{root}: no such file or folder; expected {what}: {expected}")
    found = {}
    for path in sorted({p for pattern in inside for p in _glob(root, pattern)}):
        try:
            listed = find(path, meshes)
        except InputError:
            listed = [meshes[0]]
        found |= {name(path, PurePosixPath(m)): (path, m) for m in listed}
    found |= {name(root, PurePosixPath(m)): (root, m) for m in find(root, meshes)}
    if not found:
        raise InputError(f"{root}: holds no object of {what}; expected {expected}")
    for key in found:
        # It becomes a folder's name, and stands in messages of one line.
        if not key.isprintable() or key in ("", ".", ".."):
            raise InputError(f"{root}: {key!r} is no name of an object; rename it")
    return [ScanItem(key, *found[key]) for key in sorted(found)]


def find(root: Path, patterns: Sequence[str]) -> list[str]:
    """The files in a folder or archive whose whole path matches one of the glob patterns, sorted.

    Raises:
      InputError: `root` is a file but no archive.
    """
    if root.is_dir():
        paths = {p for pattern in patterns for p in _glob(root, pattern)}
        return sorted(str(p.relative_to(root).as_posix()) for p in paths)
    return sorted(m for m in archives.members(root) if any(_matches(m, p) for p in patterns))


def folder_name(root: Path, folder: PurePosixPath) -> str:
    """The last name of `root/folder`; an archive's own, without its endings, where `folder` is empty."""
    if folder.name:
        return folder.name
    return root.resolve().name if root.is_dir() else archive_stem(root)


def archive_stem(path: Path) -> str:
    """A file's name without `.zip`, `.tgz`, `.tar.gz` and the like."""
    stem = path.name
    for ending in (".gz", ".xz", ".bz2", ".tar", ".tgz", ".zip"):
        stem = stem.removesuffix(ending)
    return stem


def hashes(item: ScanItem, members: Collection[PurePosixPath]) -> dict[str, str]:
    """The sha256 of those of `members` that are there, by file name, or by path where names recur.

    Raises:
      InputError: The archive cannot be read, or the item's own file is not there.
    """
    if item.path.is_dir():
        paths = {str(m): item.path / m for m in members}
        found = {m: sha256(path) for m, path in paths.items() if path.is_file()}
    else:
        found = archives.hashes(item.path, [str(m) for m in members])
    if item.member not in found:
        raise InputError(f"{item.where}: no such file: {item.member}; expected {item.name} there")
    names = Counter(PurePosixPath(m).name for m in found)
    keys = {m: n if names[n := PurePosixPath(m).name] == 1 else m for m in sorted(found)}
    return {key: found[m] for m, key in keys.items()}


@contextmanager
def unpacked(item: ScanItem, members: Collection[PurePosixPath]) -> Iterator[Path]:
    """The folder that holds those of `members` that exist: the item's own, or a passing one.

    Raises:
      InputError: The archive cannot be read or holds none of them.
    """
    if item.path.is_dir():
        yield item.path
        return
    with tempfile.TemporaryDirectory(prefix="manipose-scan-") as scratch:
        folder = Path(scratch) / "unpacked"
        archives.extract(item.path, folder, [str(m) for m in members])
        yield folder


@contextmanager
def opened_scan(
    item: ScanItem,
    files: Sequence[PurePosixPath],
    *,
    kind: Kind,
    up: tuple[float, float, float],
    source: str,
    licence: str,
    unit: float = 1.0,
) -> Iterator[Scan]:
    """Read one object of which nothing but a mesh and its texture is published.

    Args:
      item: The object.
      files: Its mesh, and where its texture may be.
      kind: What it is.
      up: In the mesh frame.
      source: The data set's name.
      licence: Of the data set.
      unit: Length of the file's unit [m].

    Raises:
      InputError: The archive or the mesh in it cannot be used.
    """
    with unpacked(item, files) as folder:
        mesh = load_mesh(item, folder, unit=unit)
        textures = [folder / file for file in files[1:]]
        yield Scan(
            name=item.name,
            category=kind.category,
            object_type=kind.object_type,
            mesh=mesh,
            texture=next((t for t in textures if t.is_file()), None),
            up=np.array(up),
            mass=None,
            provenance=Provenance(source, item.name, licence, hashes(item, files)),
        )


def load_mesh(item: ScanItem, folder: Path, *, unit: float = 1.0) -> trimesh.Trimesh:
    """The item's mesh in metres; errors name the archive, not the folder it was unpacked into.

    The file is first read strictly, because the reader of meshes passes over what it does not understand.

    Args:
      item: The object.
      folder: What `unpacked` gave.
      unit: Length of the file's unit [m].

    Raises:
      InputError: The mesh cannot be used.
    """
    path = folder / item.member
    try:
        if path.suffix.lower() == ".obj":
            if defects := read_lines(path, max_bytes=archives.MAX_FILE_BYTES).defects:
                log.warning("%s: %s", path, "; ".join(defects))
        elif path.suffix.lower() == ".ply":
            check_rows(path)
        return load_scan_mesh(path, unit=unit)
    except InputError as error:
        raise InputError(str(error).replace(str(folder), str(item.path))) from None


def _glob(root: Path, pattern: str) -> Iterator[Path]:
    return (p for p in root.glob(pattern) if p.is_file()) if root.is_dir() else iter(())


def _matches(member: str, pattern: str) -> bool:
    parts, patterns = PurePosixPath(member).parts, PurePosixPath(pattern).parts
    return len(parts) == len(patterns) and all(
        fnmatchcase(part, p) for part, p in zip(parts, patterns, strict=True)
    )
