"""The header of a PLY file, and whether exactly what it announces follows.

Readers of meshes are lenient: a row that lacks a number is read as if the next were its own.
http://paulbourke.net/dataformats/ply/
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from manipose_mj.errors import InputError

# Far more than any header; a file without `end_header` is not read whole.
MAX_HEADER_BYTES = 2**16
TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
RANGES = {
    kind: (int(np.iinfo(kind).min), int(np.iinfo(kind).max))
    for kind in TYPES.values()
    if not kind.startswith("f")
}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class PlyElement:
    """Attributes: name; count; properties, each a type, or the types of a list's length and items."""

    name: str
    count: int
    properties: list[tuple[str, ...]] = field(default_factory=list)


@dataclass(frozen=True)
class PlyHeader:
    """Attributes: order (`""` is text, else NumPy's byte order); elements; comments; size [bytes]."""

    order: str
    elements: list[PlyElement]
    comments: list[str]
    size: int


def read_header(path: Path) -> PlyHeader:
    """The header.

    Raises:
      InputError: The file is missing, or a line of its header is none of PLY's.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_HEADER_BYTES)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    order: str | None = None
    elements: list[PlyElement] = []
    comments: list[str] = []
    start = 0
    for number in range(1, data.count(b"\n") + 1):
        end = data.index(b"\n", start) + 1
        line = data[start:end].decode("latin-1").strip()
        start = end
        words = line.split()
        match words:
            case ["ply"] if number == 1:
                continue
            case _ if number == 1:
                break
            case ["end_header"] if order is not None:
                return PlyHeader(order, elements, comments, start)
            case ["format", name, "1.0"] if name in ORDERS and order is None:
                order = ORDERS[name]
            case ["comment" | "obj_info", *_]:
                comments.append(line)
            case ["element", name, count] if count.isdecimal():
                elements.append(PlyElement(name, int(count)))
            case ["property", kind, _] if kind in TYPES and elements:
                elements[-1].properties.append((TYPES[kind],))
            case ["property", "list", length, kind, _] if {
                length,
                kind,
            } <= TYPES.keys() and elements:
                elements[-1].properties.append((TYPES[length], TYPES[kind]))
            case _:
                _refuse(path, f"line {number} of its header cannot be read ({line[:40]!r})")
    _refuse(path, "it has no header of a PLY file")


def check_rows(path: Path) -> PlyHeader:
    """Read the header and count what follows.

    Raises:
      InputError: The header cannot be read, or there is more or less than it announces.
    """
    header = read_header(path)
    data = path.read_bytes()[header.size :]
    if header.order:
        _check_binary(path, header, data)
    else:
        _check_text(path, header, data)
    return header


def _check_text(path: Path, header: PlyHeader, data: bytes) -> None:
    rows = data.decode("latin-1").rstrip("\r\n").split("\n")
    announced = sum(element.count for element in header.elements)
    if len(rows) != announced:
        _refuse(path, f"its header announces {announced} rows, it has {len(rows)}")
    start = 0
    for element in header.elements:
        for number, row in enumerate(rows[start : start + element.count]):
            if not _is_whole(row.split(), element):
                _refuse(
                    path, f"{element.name} {number} has not the numbers that the header announces"
                )
        start += element.count


def _is_whole(fields: list[str], element: PlyElement) -> bool:
    """Whether a row holds a number for each property and nothing else."""
    place = 0
    try:
        for kinds in element.properties:
            length = 1
            if len(kinds) == 2:
                length = int(fields[place])
                place += 1
            if length < 0 or place + length > len(fields):
                return False
            for text in fields[place : place + length]:
                if kinds[-1] in RANGES:
                    low, high = RANGES[kinds[-1]]
                    if not low <= int(text) <= high:
                        return False
                else:
                    float(text)
            place += length
    except (ValueError, IndexError):
        return False
    return place == len(fields) and not any("_" in text for text in fields)


def _check_binary(path: Path, header: PlyHeader, data: bytes) -> None:
    place = 0
    for element in header.elements:
        sizes = [np.dtype(kinds[-1]).itemsize for kinds in element.properties]
        if all(len(kinds) == 1 for kinds in element.properties):
            place += element.count * sum(sizes)
            continue
        for _ in range(element.count):
            for kinds, size in zip(element.properties, sizes, strict=True):
                length = 1
                if len(kinds) == 2:
                    count = np.dtype(header.order + kinds[0])
                    if place + count.itemsize > len(data):
                        _refuse(path, f"it ends before {element.name} {element.count - 1}")
                    length = int(np.frombuffer(data, count, 1, place)[0])
                    place += count.itemsize
                if length < 0:
                    _refuse(path, f"a list of {element.name} has {length} items")
                place += length * size
    if place != len(data):
        _refuse(path, f"its header announces {place} bytes, {len(data)} follow")


def _refuse(path: Path, what: str) -> NoReturn:
    raise InputError(f"{path}: {what}; expected a whole PLY file, download it again")
