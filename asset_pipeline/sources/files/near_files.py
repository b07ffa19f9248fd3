"""The files that a mesh names (material libraries, textures, buffers), looked for in its own folder and nowhere else.

Exporters write names as their machine spells them: with backslashes, from the root of a disk, in another case, behind
options. What is at the end of such a name is found beside the mesh all the same.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote, unquote

from PIL import Image
from trimesh.resolvers import Resolver

from asset_pipeline.sources.files.images import why_unreadable
from asset_pipeline.sources.files.references import leaves
from asset_pipeline.sources.files.wavefront_lines import BYTE_ORDER_MARK, plain_lines

# Of the formats that trimesh reads, those of surfaces.
MESHES = (".obj", ".stl", ".ply", ".glb", ".gltf", ".dae", ".off", ".3mf")
IMAGES = (".png", ".jpg", ".jpeg")
_LIBRARY, _NO_IMAGES = ".mtl", (".mtl", ".bin")
_BESIDE = (*IMAGES, *_NO_IMAGES, ".webp", ".bmp", ".tga", ".tif", ".tiff")
# Of a map in a material library: `-s 1 1 1 print.png`.
_OPTIONS = re.compile(r"(-\w+(\s+(on|off|[rgbmlz]|-?[\d.]+))+\s+)+")
_COLOURS = ("map_kd", "map_ka")
_MAP = re.compile(r"(map_\w+|bump|norm|disp|decal|refl)\s", re.IGNORECASE)


class NearFiles(Resolver):
    """Gives trimesh what a mesh names, and keeps what could not be given.

    Attributes:
      file_name: The mesh's, which trimesh asks for.
      missing: What it names that is not there, as written, once each.
      unreadable: Images, each with a reason.
    """

    def __init__(self, path: Path) -> None:
        self.file_name = path.name
        self.missing: list[str] = []
        self.unreadable: list[tuple[Path, str]] = []
        self._folder = path.parent

    def get(self, key: str) -> bytes:
        """The content of the file that is meant by a name.

        Raises:
          FileNotFoundError: There is none in the mesh's folder.
        """
        file = self._found(key)
        if file is None:
            name = _without_options(key.strip())
            if name not in self.missing:
                self.missing.append(name)
            raise FileNotFoundError(key)
        data = file.read_bytes()
        if file.suffix.lower() == _LIBRARY:
            return plain_lines(data.removeprefix(BYTE_ORDER_MARK))
        if file.suffix.lower() not in _NO_IMAGES:
            self._take_image(file)
        return data

    def lacks(self) -> str:
        """One phrase of what is missing; empty where nothing is."""
        foreign = [name for name in self.missing if leaves(name)]
        absent = [name for name in self.missing if name not in foreign]
        # The lines of an OBJ file tell of its libraries elsewhere.
        foreign = [name for name in foreign if not name.lower().endswith(_LIBRARY)]
        phrases = []
        if absent:
            phrases.append(f"{', '.join(absent)}, which {_are(absent)} not there")
        if foreign:
            phrases.append(
                f"{', '.join(foreign)}, outside its folder, which {_are(foreign)} not opened"
            )
        return "names " + "; ".join(phrases) if phrases else ""

    def keys(self) -> Iterator[str]:
        """What could be asked for: one folder below the mesh at most."""
        return (file.relative_to(self._folder).as_posix() for file in _near(self._folder))

    def write(self, name: str, data: bytes) -> None:
        """Nothing is written beside a person's mesh."""
        raise NotImplementedError

    def namespaced(self, namespace: str) -> NearFiles:
        """Of a folder below."""
        return NearFiles(self._folder / namespace / self.file_name)

    def _found(self, name: str) -> Path | None:
        """The file by the whole name if there is one, else by its last folders, else by its last part."""
        text = _without_options(name.strip())
        folder = self._folder.resolve()
        spelt = {key.lower(): self._folder / key for key in self.keys()}
        for written in (text, unquote(text)):
            parts = written.replace("\\", "/").split("/")
            for start in range(len(parts)):
                end = "/".join(parts[start:])
                if not end.isprintable() or end in ("", ".", ".."):
                    continue
                for file in (self._folder / end, spelt.get(end.lower())):
                    if file and file.is_file() and file.resolve().is_relative_to(folder):
                        return file
        return None

    def _take_image(self, file: Path) -> None:
        try:
            with Image.open(file) as image:
                image.load()
        except Exception as error:
            self.unreadable.append((file, why_unreadable(error)))


def is_hidden(name: str) -> bool:
    """Whether a file or folder is hidden, or one of those that macOS writes into archives: `._mug.stl`, `__MACOSX`."""
    return name.startswith(".") or name == "__MACOSX"


def companions(path: Path) -> list[Path]:
    """The files beside a mesh, or one folder below, that it or its material library names, sorted.

    Where no image among them may be its colour, that which `colour_beside` finds is one of them.
    """
    found, texts = _named(path)
    others = _other_maps(path, found, texts)
    images = {file for file in found if file.suffix.lower() in IMAGES} - others
    if not images and (image := _beside(path, others)):
        found.add(image)
    return sorted(found)


def colour_beside(path: Path) -> Path | None:
    """The image that colours a mesh which names none: of the mesh's own name, or the only one where the mesh is, too.

    Images that are said to be something else, such as a normal map, do not count.
    """
    return _beside(path, _other_maps(path, *_named(path)))


def _named(path: Path) -> tuple[set[Path], list[bytes]]:
    """The files that a mesh and its libraries name, and the libraries' texts, in small letters."""
    near = list(_near(path.parent))
    found: set[Path] = set()
    libraries: list[bytes] = []
    texts = [path.read_bytes().lower()]
    while texts:
        text = texts.pop()
        for file in near:
            names = {file.name.lower().encode(), quote(file.name).lower().encode()}
            if file not in found and any(name in text for name in names):
                found.add(file)
                if file.suffix.lower() == _LIBRARY:
                    libraries.append(file.read_bytes().lower())
                    texts.append(libraries[-1])
    return found, libraries


def _other_maps(path: Path, found: set[Path], libraries: list[bytes]) -> set[Path]:
    """Images that are named, but not as a colour."""
    images = {file for file in found if file.suffix.lower() in IMAGES}
    if path.suffix.lower() in (".glb", ".gltf"):
        return images  # had it been the colour, trimesh would have it
    lines = [
        line.strip() for text in libraries for line in text.decode("utf-8", "replace").split("\n")
    ]
    colours = [line for line in lines if line.startswith(_COLOURS)]
    others = [line for line in lines if _MAP.match(line) and not line.startswith(_COLOURS)]
    return {
        image
        for image in images
        if _ends(others, image.name.lower()) and not _ends(colours, image.name.lower())
    }


def _ends(lines: list[str], name: str) -> bool:
    return any(re.search(rf"[\s/\\]{re.escape(name)}$", line) for line in lines)


def _beside(path: Path, others: set[Path]) -> Path | None:
    files = [f for f in sorted(path.parent.iterdir()) if f.is_file() and not is_hidden(f.name)]
    images = [f for f in files if f.suffix.lower() in IMAGES and f not in others]
    named = [f for f in images if f.stem == path.stem]
    alone = len(images) == 1 and sum(f.suffix.lower() in MESHES for f in files) == 1
    return (named or (images if alone else [None]))[0]


def _near(folder: Path) -> Iterator[Path]:
    for pattern in ("*", "*/*"):
        for file in sorted(folder.glob(pattern)):
            hidden = any(map(is_hidden, file.relative_to(folder).parts))
            if file.suffix.lower() in _BESIDE and file.is_file() and not hidden:
                yield file


def _without_options(name: str) -> str:
    return _OPTIONS.sub("", name, count=1) if name.startswith("-") else name


def _are(names: list[str]) -> str:
    return "is" if len(names) == 1 else "are"
