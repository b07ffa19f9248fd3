"""The lines of a Wavefront OBJ file as arrays, each line checked, and what looks damaged in them.

A damaged file that still reads is worse than one that does not. What a sound exporter never writes is
therefore refused (a face of two corners) or told (an unknown keyword, a vertex that no face uses). That
all of it holds for published files was checked on 24 YCB, 8 Google and 458 PartNet-Mobility meshes.
"""

from __future__ import annotations

import io
import re
from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Float, Int

from asset_pipeline.sources.files.references import leaves
from manipose_mj.errors import InputError

# http://paulbourke.net/dataformats/obj/, without the curves that no scan has; the last three are MeshLab's
# and Blender's.
KEYWORDS = frozenset({
    "v", "vt", "vn", "vp", "f", "l", "p", "o", "g", "s", "usemtl", "mtllib", "usemap", "maplib",
    "mg", "lod", "bevel", "c_interp", "d_interp", "shadow_obj", "trace_obj", "vc", "surf",
    "mtl",
})  # fmt: skip
NAMES = ("vertex", "texture coordinate", "normal")
_PLURAL = ("vertices", "texture coordinates", "normals")
STATED = {"vertices": 0, "faces": 1}  # `# Vertices: 8006`, as Katamari's and MeshLab's files begin


BYTE_ORDER_MARK = b"\xef\xbb\xbf"  # opens what some editors save


@dataclass(frozen=True)
class WavefrontLines:
    """The content of an OBJ file.

    Attributes:
      vertices: `(v, 3)`, in the file's unit.
      coordinates: `(t, 2)`, of textures.
      normals: `(n, 3)`, as written.
      corners: `(c, 3)`, of all faces: indices of vertex, texture coordinate and normal from 0; -1 where
        a corner has none.
      sizes: `(f,)`, how many corners each face has, 3 or more.
      materials: `(f,)`, the index in `names` of each face's material.
      names: Of materials, as the faces use them; the empty one for those before any.
      libraries: File names of the material libraries, without folders.
      defects: What looks damaged, one phrase each.
    """

    vertices: Float[np.ndarray, "v 3"]
    coordinates: Float[np.ndarray, "t 2"]
    normals: Float[np.ndarray, "n 3"]
    corners: Int[np.ndarray, "c 3"]
    sizes: Int[np.ndarray, " f"]
    materials: Int[np.ndarray, " f"]
    names: tuple[str, ...]
    libraries: tuple[str, ...]
    defects: tuple[str, ...]


def read_lines(path: Path, *, max_bytes: int) -> WavefrontLines:
    """Read an OBJ file.

    Raises:
      InputError: Missing or too large; a line cannot be read; a face has less than 3 corners or names
        what is not there; a vertex is NaN or infinite.
    """
    text = plain_lines(read_text(path, max_bytes=max_bytes).encode()).decode()
    reader = _Reader()
    for number, line in enumerate(text.split("\n"), start=1):
        keyword, _, rest = line.strip().partition(" ")
        try:
            reader.take(number, keyword, rest)
        except ValueError as error:
            raise InputError(f"{path}: line {number} cannot be read ({error})") from None
    return reader.finished(path, text)


def read_text(path: Path, *, max_bytes: int) -> str:
    """A text file of a stranger, without a byte order mark.

    Raises:
      InputError: Missing or too large.
    """
    try:
        if path.stat().st_size > max_bytes:
            raise InputError(f"{path}: larger than {max_bytes >> 20} MiB; expected a mesh")
        return path.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def plain_lines(data: bytes) -> bytes:
    """Lines as every reader takes them: they end with a newline, go on in no other, and have blanks for tabs."""
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data.replace(b"\\\n", b" ").replace(b"\t", b" ")


@contextmanager
def for_readers(path: Path) -> Iterator[BinaryIO]:
    """A file, open behind its byte order mark, which would hide the first line; an OBJ file with plain lines."""
    with path.open("rb") as file:
        if path.suffix.lower() == ".obj":
            yield io.BytesIO(plain_lines(file.read().removeprefix(BYTE_ORDER_MARK)))
            return
        if file.read(len(BYTE_ORDER_MARK)) != BYTE_ORDER_MARK:
            file.seek(0)
            yield file
        else:
            yield io.BytesIO(file.read())


def numbers(text: str, least: int, what: str) -> list[float]:
    """The first `least` numbers in a line; `what` says how many there should be.

    Raises:
      ValueError: There are less, or one is none.
    """
    fields = text.split()
    if len(fields) < least:
        raise ValueError(what)
    if "_" in text:  # Python reads 1_0 as 10
        raise ValueError(f"{text.strip()!r} are no numbers")
    return [float(field) for field in fields[:least]]


class _Reader:
    """Takes the lines one by one."""

    def __init__(self) -> None:
        self.vertices, self.coordinates, self.normals = array("d"), array("d"), array("d")
        self.corners, self.sizes, self.materials = array("q"), array("q"), array("q")
        self.names = [""]
        self.material = 0
        self.libraries: list[str] = []
        self.points_and_lines: set[int] = set()  # vertices of lines and points
        self.unknown: list[str] = []
        self.mixed: list[int] = []
        self.foreign: list[str] = []
        self.stated: dict[int, int] = {}
        self.comments = 0

    def take(self, number: int, keyword: str, rest: str) -> None:
        if keyword == "v":
            self.vertices.extend(numbers(rest, 3, "a vertex has 3 coordinates"))
        elif keyword == "vt":
            self.coordinates.extend(numbers(rest, 2, "a texture coordinate has 2 numbers"))
        elif keyword == "vn":
            self.normals.extend(numbers(rest, 3, "a normal has 3 numbers"))
        elif keyword == "f":
            self._take_face(number, rest)
        elif keyword in ("l", "p"):
            indices = [int(field.split("/")[0]) for field in rest.split()]
            self.points_and_lines |= {
                i - 1 if i > 0 else len(self.vertices) // 3 + i for i in indices
            }
        elif keyword == "usemtl":
            name = rest.strip()
            if name not in self.names:
                self.names.append(name)
            self.material = self.names.index(name)
        elif keyword == "mtllib":
            if leaves(rest.strip()):
                self.foreign.append(rest.strip())
            name = re.split(r"[/\\]", rest.strip())[-1]
            if name.isprintable() and name not in ("", ".", ".."):
                self.libraries.append(name)
        elif keyword.startswith("#"):
            self.comments += 1
            if found := re.fullmatch(r"(Vertices|Faces): (\d{1,9})", rest.strip(), re.IGNORECASE):
                self.stated[STATED[found[1].lower()]] = int(found[2])
        elif keyword and keyword not in KEYWORDS:
            self.unknown.append(f"line {number}: {keyword[:20]!r}")

    def _take_face(self, number: int, rest: str) -> None:
        counts = len(self.vertices) // 3, len(self.coordinates) // 2, len(self.normals) // 3
        fields = rest.split()
        if len(fields) < 3:
            raise ValueError(f"a face has at least 3 corners, this one {len(fields)}")
        forms = set()
        for field in fields:
            indices = field.split("/")
            if len(indices) > 3 or "_" in field:
                raise ValueError(f"{field!r} is no corner of a face")
            for what, text, count in zip(NAMES, (*indices, "", "")[:3], counts, strict=True):
                if not text and what != "vertex":
                    self.corners.append(-1)
                    continue
                index = int(text)
                from_zero = index - 1 if index > 0 else count + index
                if index == 0 or not 0 <= from_zero < count:
                    raise ValueError(f"names {what} {index} of {count}")
                self.corners.append(from_zero)
            forms.add(tuple((bool(text), text.startswith("-")) for text in indices))
        if len(forms) > 1:
            self.mixed.append(number)
        self.sizes.append(len(fields))
        self.materials.append(self.material)

    def finished(self, path: Path, text: str) -> WavefrontLines:
        points = np.array(self.vertices).reshape(-1, 3)
        if not np.isfinite(points).all():
            raise InputError(f"{path}: a vertex is NaN or infinite; expected finite coordinates")
        corners = np.array(self.corners, int).reshape(-1, 3)
        values = points, np.array(self.coordinates).reshape(-1, 2), np.array(self.normals).reshape(-1, 3)  # fmt: skip
        return WavefrontLines(
            *values,
            corners=corners,
            sizes=np.array(self.sizes, int),
            materials=np.array(self.materials, int),
            names=tuple(self.names),
            libraries=tuple(self.libraries),
            defects=(
                *self._defects(text),
                *_unused(values, corners, self.points_and_lines),
                *self._miscounted(),
            ),
        )

    def _defects(self, text: str) -> list[str]:
        found = [
            f"it names {name!r}, outside its folder, which is not opened" for name in self.foreign
        ]
        if self.unknown:
            more = f" and {len(self.unknown) - 1} more" if len(self.unknown) > 1 else ""
            found.append(f"{self.unknown[0]} is no keyword of OBJ{more}")
        if self.mixed:
            found.append(
                f"the corners of the face in line {self.mixed[0]} are written unlike each other"
            )
        if re.search(r"[\0-\x08\x0b\x0c\x0e-\x1f]", text):
            found.append("it holds control characters")
        # Exporters that begin with a comment end with a newline; the others do as they please.
        if self.comments and not text.endswith("\n"):
            found.append("it does not end with a newline and may be cut off")
        return found

    def _miscounted(self) -> list[str]:
        have = len(self.vertices) // 3, len(self.sizes)
        return [
            f"its header says {count} {what}, it has {have[i]}"
            for what, i in STATED.items()
            if (count := self.stated.get(i, have[i])) != have[i]
        ]


def _unused(
    values: tuple[np.ndarray, ...], corners: Int[np.ndarray, "c 3"], points_and_lines: set[int]
) -> list[str]:
    """Rows that no face names: what is left where faces were cut off or an index was damaged."""
    found = []
    for what, rows, used in zip(_PLURAL, values, corners.T, strict=True):
        named = set(used[used >= 0].tolist()) | (points_and_lines if what == "vertices" else set())
        spare = len(rows) - len(named)
        if len(corners) and spare:
            found.append(f"{spare} of {len(rows)} {what} belong to no face; it may be cut off")
    return found
