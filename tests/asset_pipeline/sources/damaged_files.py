"""Hypothesis strategies that damage valid objects in every publisher's layout."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

import tests.asset_pipeline.scan_files as files
from tests.asset_pipeline.sources.valid_files import FINE, SOURCES, URDF, Files, valid

Draw = Callable[[Any], Any]


@dataclass(frozen=True)
class Case:
    """A data set of one object, damaged.

    Attributes:
      source: Whose layout.
      damage: What was done to it.
      content: Its files.
      archive: Ending of the archive that it comes in; empty for a folder.
      cut: Where the archive was cut off, as a share of its length; 1 leaves it whole.
    """

    source: str
    damage: str
    content: Files
    archive: str
    cut: float = 1.0

    def write(self, root: Path) -> Path:
        """Write it below `root` and return what a reader is given."""
        if not self.archive:
            assert not any(n.startswith("/") or ".." in n for n in self.content)
            folder = root / "data"
            folder.mkdir(parents=True)
            return files.write_folder(folder, self.content)
        path = root / f"001_thing_google_16k{self.archive}"
        files.write_archive(path, self.content)
        path.write_bytes(path.read_bytes()[: int(self.cut * path.stat().st_size)])
        return path


@st.composite
def cases(draw: Draw, sources: tuple[str, ...] = SOURCES, subdivisions: int = FINE) -> Case:
    """A damaged data set."""
    source = draw(st.sampled_from(sources))
    whole = valid(source, subdivisions)
    damages = ANY | (URDFS if source == "partnet_mobility" else {})
    damage = draw(st.sampled_from(sorted(damages)))
    content = damages[damage](draw, whole)
    packed = [".tgz"] if source == "ycb" else [".zip", ".tgz"]
    # Only an archive can hold a file that is not below it.
    archive = draw(st.sampled_from(packed if damage == "path escape" else ["", *packed]))
    if archive and damage == "truncated" and draw(st.booleans()):
        return Case(source, "truncated archive", whole, archive, draw(st.floats(0, 0.999)))
    return Case(source, damage, content, archive)


def _some(draw: Draw, content: Files, ending: str) -> str:
    return draw(st.sampled_from(sorted(n for n in content if re.search(ending, n))))


MESH = r"\.(obj|ply)$"


def _dice(draw: Draw) -> np.random.Generator:
    """For places in a file: hypothesis itself likes the first and the last ones too much."""
    return np.random.default_rng(draw(st.integers(0, 10**6)))


def _truncated(draw: Draw, content: Files) -> Files:
    name = _some(draw, content, "")
    return content | {name: content[name][: _dice(draw).integers(0, len(content[name]) - 1)]}


def _flipped(draw: Draw, content: Files) -> Files:
    """Bytes become others; in half of the cases digits only, so that numbers stay numbers."""
    name = _some(draw, content, "")
    data, dice = bytearray(content[name]), _dice(draw)
    digits = [i for i, byte in enumerate(data) if 48 <= byte <= 57]
    if draw(st.booleans()) and digits and not re.search("png|jpg", name):
        for place in dice.choice(digits, dice.integers(1, 4)):
            data[place] = 48 + (data[place] - 48 + dice.integers(1, 10)) % 10
    else:
        for place in dice.integers(0, len(data), dice.integers(1, 20)):
            data[place] ^= dice.integers(1, 256)
    return content | {name: bytes(data)}


def _garbage(draw: Draw, content: Files) -> Files:
    return content | {_some(draw, content, ""): draw(st.binary(max_size=300))}


def _empty(draw: Draw, content: Files) -> Files:
    return content | {_some(draw, content, ""): b""}


def _missing(draw: Draw, content: Files) -> Files:
    gone = _some(draw, content, "")
    return {n: c for n, c in content.items() if n != gone}


def _with_vertices(content: Files, name: str, change: Callable[[list[str], int], Any]) -> Files:
    """Every line of a vertex, its three coordinates changed by `change(coordinates, number)`."""
    lines = content[name].decode().split("\n")
    is_ply = name.endswith(".ply")
    count = 0
    for i, line in enumerate(lines):
        fields = line.split(" ")
        first = 0 if is_ply else 1
        vertex = len(fields) == 5 if is_ply else fields[0] == "v"
        if vertex and re.match(r"[-\d]", fields[first]):
            fields[first : first + 3] = [str(v) for v in change(fields[first : first + 3], count)]
            lines[i] = " ".join(fields)
            count += 1
    return content | {name: "\n".join(lines).encode()}


def _nan(draw: Draw, content: Files) -> Files:
    bad = draw(st.sampled_from(["nan", "inf", "-inf", "1e999", "-nan", "", "0x10", "1,5", "--1"]))
    which, axis = draw(st.integers(0, 7)), draw(st.integers(0, 2))

    def change(values: list[str], number: int) -> list[str]:
        return [bad if (number, i) == (which, axis) else v for i, v in enumerate(values)]

    return _with_vertices(content, _some(draw, content, MESH), change)


def _zero_area(draw: Draw, content: Files) -> Files:
    kept = draw(st.sampled_from([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 1, 1)]))

    def change(values: list[str], number: int) -> list[float]:
        return [float(v) * k for v, k in zip(values, kept, strict=True)]

    return _with_vertices(content, _some(draw, content, MESH), change)


def _scaled(draw: Draw, content: Files, factors: list[float]) -> Files:
    factor = draw(st.sampled_from(factors))
    for name in [n for n in content if re.search(MESH, n)]:
        content = _with_vertices(content, name, lambda v, _: [factor * float(x) for x in v])
    return content


def _gigantic(draw: Draw, content: Files) -> Files:
    return _scaled(draw, content, [1e5, 1e9, 1e20, 1e38, 1e150, 1e300])


def _units(draw: Draw, content: Files) -> Files:
    return _scaled(draw, content, [0.001, 0.01, 0.0254, 39.37, 100.0, 1000.0])


def _one_far_vertex(draw: Draw, content: Files) -> Files:
    far = draw(st.sampled_from(["1e6", "1e30", "1e300"]))
    which = draw(st.integers(0, 7))
    return _with_vertices(
        content, _some(draw, content, MESH), lambda v, n: [far, *v[1:]] if n == which else v
    )


def _inverted(draw: Draw, content: Files) -> Files:
    """All faces, or some, the wrong way round."""
    name = _some(draw, content, MESH)
    turned = draw(st.sets(st.integers(0, 11), min_size=1)) if draw(st.booleans()) else range(12)
    lines = content[name].decode().split("\n")
    faces = [i for i, line in enumerate(lines) if re.match(r"f |3 \d+ \d+ \d+ 6", line)]
    for i in np.array(faces)[sorted(turned)]:
        fields = lines[i].split(" ")
        fields[1:4] = fields[3:0:-1]
        lines[i] = " ".join(fields)
    return content | {name: "\n".join(lines).encode()}


def _wrong_index(draw: Draw, content: Files) -> Files:
    name = _some(draw, content, MESH)
    index = draw(st.sampled_from(["0", "-1", "-99", "99", "4294967296", "99999999999999999999"]))
    pattern = rb"(?m)^f \d+/\d+" if name.endswith(".obj") else rb"(?m)^3 \d+(?= \d+ \d+ 6)"
    text = f"f {index}/1" if name.endswith(".obj") else f"3 {index}"
    return content | {name: re.sub(pattern, text.encode(), content[name], count=1)}


def _huge_count(draw: Draw, content: Files) -> Files:
    """A PLY that announces more than it has; an OBJ with a polygon of one corner."""
    name = _some(draw, content, MESH)
    count = draw(st.sampled_from([b"9", b"1000000000000", b"-3", b"x"]))
    what = draw(st.sampled_from([b"vertex", b"face"]))
    data = re.sub(rb"element %s \d+" % what, b"element %s %s" % (what, count), content[name])
    return content | {name: data if data != content[name] else data + b"f 1\n"}


def _reference(draw: Draw, content: Files) -> Files:
    """Textures and material libraries outside the folder."""
    to = draw(st.sampled_from([b"../../../../etc/passwd", b"/etc/passwd", b"C:\\x.png", b"a\0b"]))
    name = _some(draw, content, r"\.(obj|ply|mtl)$")
    pattern = rb"(?m)^(mtllib|map_Kd|comment TextureFile) .*$"
    return content | {name: re.sub(pattern, lambda m: m[1] + b" " + to, content[name])}


def _escape(draw: Draw, content: Files) -> Files:
    name = draw(
        st.sampled_from(
            ["../evil", "../../evil", "/evil", "x/../../evil", "..\\evil", "./../evil", "x/.."]
        )
    )
    return content | {name: b"evil"}


ANY: dict[str, Callable[[Draw, Files], Files]] = {
    "truncated": _truncated,
    "bytes flipped": _flipped,
    "garbage": _garbage,
    "empty": _empty,
    "missing": _missing,
    "NaN": _nan,
    "zero area": _zero_area,
    "gigantic": _gigantic,
    "wrong units": _units,
    "one far vertex": _one_far_vertex,
    "inverted": _inverted,
    "wrong index": _wrong_index,
    "wrong count": _huge_count,
    "foreign reference": _reference,
    "path escape": _escape,
}


def _urdf(old: str, *new: str) -> Callable[[Draw, Files], Files]:
    def damage(draw: Draw, content: Files) -> Files:
        name = _some(draw, content, "urdf$")
        text = URDF.replace(old, draw(st.sampled_from(new)))
        assert text != URDF
        return content | {name: text.encode()}

    return damage


BOMB = "".join(
    f'<!ENTITY a{i} "{f"&a{i - 1};" * 10 if i else "lol"}">' for i in range(10)
)  # ten thousand million "lol"


def _odd_json(draw: Draw, content: Files) -> Files:
    values = st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(st.sampled_from(["id", "jointData", "limit", "model_cat"]), inner)
        ),
        max_leaves=8,
    )
    text = json.dumps(draw(values)) if draw(st.booleans()) else "[" * 100_000
    return content | {_some(draw, content, r"json$"): text.encode()}


URDFS: dict[str, Callable[[Draw, Files], Files]] = {
    "cyclic URDF": _urdf(
        '<parent link="base"/>', '<parent link="link_1"/>', '<parent link="link_0"/>'
    ),
    "entity expansion": _urdf(
        "<robot",
        f"<!DOCTYPE robot [{BOMB}]><robot title='&a9;'",
        "<!DOCTYPE robot [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><robot",
    ),
    "mesh outside": _urdf(
        "textured_objs/original-1.obj",
        "../../../../etc/passwd",
        "/etc/passwd",
        "file:///etc/passwd",
        "textured_objs/../../../x.obj",
    ),
    "mesh missing": _urdf(
        "textured_objs/original-1.obj", "textured_objs/original-9.obj", "textured_objs"
    ),
    "URDF number": _urdf(
        'upper="1.5707963"', 'upper="nan"', 'upper="-9"', 'upper="1e300"', 'upper=""', 'upper="1e9"'
    ),
    "URDF axis": _urdf(
        '<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', '<axis xyz="1"/>', '<axis xyz="inf 0 0"/>'
    ),
    "URDF links": _urdf('<link name="base"/>', "", '<link name="link_0"/>', "<link/>" * 3000),
    "odd JSON": _odd_json,
}
