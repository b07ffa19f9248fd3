"""Own meshes: a file, or a folder of files, of any format that `files.mesh_file` reads.

What the files do not say is said by who builds them (`MeshOptions`), or guessed, with a warning that names the
guess. An object is named for its file, or for its folder where the file is called `model` or the like. The mesh
frame is kept, scaled to metres, but where its origin is far from the object. Nothing is claimed of where a mesh comes from.
"""

from __future__ import annotations

import logging
import os
import re
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from asset_pipeline.sources.categories import Kind, kind_of, kind_of_file
from asset_pipeline.sources.files.mesh_file import ANONYMOUS, MeshFile, read_mesh_file
from asset_pipeline.sources.files.near_files import MESHES, companions, is_hidden
from asset_pipeline.sources.mesh_guesses import AXES, UNITS, guess_unit, guess_up, suits
from asset_pipeline.sources.scan import Scan, ScanItem, check_scan_mesh, sha256
from manipose_mj.assets.asset import Provenance
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.label import ObjectType
from manipose_mj.errors import InputError, unknown_name

log = logging.getLogger(__name__)

SOURCE = "own mesh"
UNKNOWN_LICENCE = "unknown"
TYPES: tuple[ObjectType, ...] = ("axial", "mirror", "functional")
# In an asset's inputs: what was said of it.
SAID = "as said"


@dataclass(frozen=True)
class MeshOptions:
    """What a person says of own meshes; None is guessed.

    Attributes:
      category: What kind of objects they are, such as `"mug"`.
      object_type: Which labelling rule applies; without it the category's.
      up: `"x"`, `"y"`, `"z"`, `"-x"`, `"-y"` or `"-z"`.
      unit: `"m"`, `"cm"`, `"mm"`, `"in"`, `"ft"` or a number of metres.
      licence: Under which the meshes may be used; without it the asset says that it is unknown.

    Raises:
      InputError: One of them cannot be meant.
    """

    category: str | None = None
    object_type: ObjectType | None = None
    up: str | None = None
    unit: str | None = None
    licence: str | None = None

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is not None and not isinstance(value, str):
                raise InputError(f"--{name.replace('object_', '')} is {value!r}; expected text")
        if self.category is not None:
            kind = kind_of(self.category)
            if not kind.category:
                raise InputError(
                    f"--category {self.category!r} has no letter or digit; expected a word such as mug"
                )
            if self.object_type is None and kind.object_type not in TYPES:
                raise InputError(
                    f"--category {self.category}: has parts that move, which a mesh does not tell; "
                    "say --type for one that is rigid, or another category"
                )
        if self.up is not None and self.up not in AXES:
            raise unknown_name("axis", self.up, AXES)
        if self.object_type is not None and self.object_type not in TYPES:
            raise unknown_name("type", self.object_type, TYPES)
        if self.unit is not None:
            metres(self.unit)

    def remarks(self) -> list[str]:
        """What should be known before anything is built, one line each."""
        found = []
        if not self.licence:
            found.append("no licence is stated: the assets will say 'unknown'; say --licence TEXT")
        if self.category and self.object_type is None and self.category not in CATALOGUE:
            kind = kind_of(self.category)
            if kind.category not in CATALOGUE:
                hint = unknown_name("category", self.category, CATALOGUE)
                found.append(
                    f"labelled as {kind.object_type}, say --type where that is wrong: {hint}"
                )
        return found


@dataclass(frozen=True)
class MeshItem(ScanItem):
    """A mesh file, and what was said of it."""

    options: MeshOptions = field(default_factory=MeshOptions)

    @property
    def file(self) -> Path:
        """The mesh."""
        return self.path / self.member

    @property
    def where(self) -> str:
        """What messages name: the file."""
        return str(self.file)


def metres(unit: str) -> float:
    """The length of a unit [m].

    Raises:
      InputError: It is neither a known one nor a number above 0.
    """
    if unit in UNITS:
        return UNITS[unit]
    try:
        length = float(unit)
    except ValueError:
        raise unknown_name("unit", unit, [*UNITS, "a number of metres"]) from None
    if not 0 < length < np.inf:
        raise InputError(f"unit {unit!r}; expected a number of metres above 0")
    return length


def items(path: Path, options: MeshOptions) -> list[MeshItem]:
    """The meshes at `path`: the file itself, or those in the folder and in its folders, but for hidden ones.

    Meshes farther down and links that lead nowhere are left out, with a warning.

    Raises:
      InputError: `path` does not exist, or holds no mesh.
    """
    expected = " ".join(MESHES)
    if path.is_file():
        if path.suffix.lower() not in MESHES:
            raise InputError(f"{path}: no mesh that can be read; expected one of {expected}")
        root, files = path.parent, [path]
    elif path.is_dir():
        root, files = path, _meshes_in(path)
    else:
        raise InputError(f"{path}: no such file or folder; expected a mesh or a folder of meshes")
    if not files:
        raise InputError(
            f"{path}: holds no mesh; expected one of {expected}, there or a folder below"
        )
    names = [_name(file) for file in files]
    counts = Counter(names)
    found = {}
    for file, name in zip(files, names, strict=True):
        own = name if counts[name] == 1 else _spelt("_".join(file.relative_to(root).parts))
        if own in found:
            raise InputError(f"{path}: {found[own].file} and {file} have one name; rename one")
        found[own] = MeshItem(own, root, str(file.relative_to(root)), options)
    return [found[name] for name in sorted(found)]


def inputs(item: MeshItem) -> dict[str, str]:
    """The sha256 of every file that the object is built from, keyed by file name; and what was said of it.

    Raises:
      InputError: A file cannot be read.
    """
    hashes = {item.file.name: sha256(item.file)}
    hashes |= {str(f.relative_to(item.file.parent)): sha256(f) for f in companions(item.file)}
    said = {key: value for key, value in asdict(item.options).items() if value is not None}
    return hashes | {SAID: ", ".join(f"{key}={value}" for key, value in said.items())}


@contextmanager
def opened(item: MeshItem) -> Iterator[Scan]:
    """Read one object; its texture stays there as long as the context does.

    Raises:
      InputError: The mesh cannot be used, or no unit suits it.
    """
    options, file = item.options, item.file
    found = read_mesh_file(file)
    mesh, guesses = found.mesh, []
    kind = kind_of(options.category or "")
    if options.category is None:
        kind = kind_of_file(item.name)
        guesses.append(f"category {kind.category} by its name (--category)")
    kind = Kind(kind.category, options.object_type or kind.object_type)
    unit = options.unit
    if unit is None:
        unit, origin = _unit(found, kind.category, file)
        size = metres(unit) * float(np.ptp(np.asarray(mesh.vertices), axis=0).max())
        said = unit if unit in UNITS else f"of {unit} m"
        guesses.append(f"unit {said} {origin}, so that it measures {size:.3g} m (--unit)")
    mesh.vertices = metres(unit) * np.asarray(mesh.vertices)
    check_scan_mesh(mesh, str(file), unit=metres(unit))
    up = options.up
    if up is None:
        up = guess_up(mesh, kind.object_type, found.up)
        guesses.append(f"{up} up (--up)")
    if guesses:
        log.warning("%s: not stated and taken to be: %s", file, "; ".join(guesses))
    with tempfile.TemporaryDirectory(prefix="manipose-scan-") as scratch:
        texture = None
        if found.image is not None:
            texture = Path(scratch) / "texture.png"
            found.image.save(texture)
        yield Scan(
            name=item.name,
            category=kind.category,
            object_type=kind.object_type,
            mesh=mesh,
            texture=texture,
            up=np.array(AXES[up]),
            mass=None,
            provenance=Provenance(
                SOURCE, item.member, options.licence or UNKNOWN_LICENCE, inputs(item)
            ),
            rgba=found.rgba,
        )


def _unit(found: MeshFile, category: str, file: Path) -> tuple[str, str]:
    """The unit that nobody gave, and where it is from."""
    vertices = np.asarray(found.mesh.vertices)
    longest = float(np.ptp(vertices, axis=0).max()) if np.isfinite(vertices).all() else 0.0
    if longest == 0:
        return "m", "for want of a size"  # which is refused next
    if found.unit is not None and suits(found.unit * longest, category):
        return f"{found.unit:g}", "as the file says"
    try:
        return guess_unit(longest, category), "by its size"
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def _meshes_in(folder: Path) -> list[Path]:
    """Those in a folder and in its folders, and a warning of what is left out."""
    found, broken, deep = [], [], []
    whole = folder.resolve()
    for pattern in ("*", "*/*"):
        for file in sorted(folder.glob(pattern)):
            if file.parent != folder and whole.is_relative_to(file.parent.resolve()):
                continue  # a link back
            if _is_shown_mesh(file.relative_to(folder)):
                if file.is_file():
                    found.append(file)
                elif file.is_symlink():
                    broken.append(file)
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if not is_hidden(name))
        files = (Path(place, name).relative_to(folder) for name in sorted(names))
        deep += [file for file in files if len(file.parts) > 2 and _is_shown_mesh(file)]
    broken = [file.relative_to(folder) for file in broken]
    _tell_left_out(folder, broken, "a link that leads", "links that lead", "nowhere")
    where = "more than one folder down (to build it, name its folder as PATH)"
    _tell_left_out(folder, deep, "which lies", "which lie", where)
    return found


def _tell_left_out(folder: Path, files: list[Path], one: str, several: str, why: str) -> None:
    if files:
        what = f"1 mesh, {one}" if len(files) == 1 else f"{len(files)} meshes, {several}"
        more = " and others" if len(files) > 1 else ""
        log.warning("%s: left out %s %s: %s%s", folder, what, why, files[0], more)


def _is_shown_mesh(file: Path) -> bool:
    return file.suffix.lower() in MESHES and not any(map(is_hidden, file.parts))


def _name(file: Path) -> str:
    """Of the file; of its folder where the file's says nothing."""
    anonymous = file.stem.lower() in ANONYMOUS
    return _spelt(file.parent.resolve().name if anonymous else file.stem)


def _spelt(text: str) -> str:
    """With letters, digits and `_.-` only: it becomes a folder's name, and a name in MJCF."""
    name = re.sub(r"[^\w.-]+", "_", text).strip("._") or "object"
    return "world_object" if name == "world" else name  # MuJoCo's own body has that name
