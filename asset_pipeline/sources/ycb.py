"""The YCB objects as published: `<id>_google_16k.tgz`, or `<id>/google_16k/textured.obj` unpacked.

Units are metres and z is up; the mesh frame is kept as published, because the poses of data sets
built on YCB refer to it. https://www.ycbbenchmarks.com, CC BY 4.0.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Literal

import numpy as np

from asset_pipeline.sources import collection
from asset_pipeline.sources.categories import kind_of
from asset_pipeline.sources.files.wavefront_materials import read_materials
from asset_pipeline.sources.scan import Scan, ScanItem, sha256
from manipose_mj.assets.asset import Provenance
from manipose_mj.assets.label import ObjectType
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

SOURCE = "YCB, google_16k"
LICENCE = "CC BY 4.0"
SUFFIX = "_google_16k.tgz"
MESH = Path("google_16k") / "textured.obj"
TEXTURE = "texture_map.png"
LIBRARY = "textured.mtl"


@dataclass(frozen=True)
class YcbObject:
    """What the mesh does not say: category, labelling rule, mass [g] and how it is filled."""

    category: str
    object_type: ObjectType
    grams: float | None = None
    fill: Literal["solid", "shell"] = "solid"
    functional: tuple[float, float, float] | None = None


def _axial(category: str, grams: float | None = None, **more) -> YcbObject:
    return YcbObject(category, "axial", grams, **more)


def _mirror(category: str, grams: float | None = None, **more) -> YcbObject:
    return YcbObject(category, "mirror", grams, **more)


def _tool(category: str, grams: float | None = None, **more) -> YcbObject:
    return YcbObject(category, "functional", grams, **more)


# Categories are ours where we have the kind; the type is the scan's own, since an oval bottle is no body of
# revolution. Masses: the object table of Calli et al., "The YCB Object and Model Set" (2015), by way of copies
# in public code, not of the paper itself. Two that cite it (the object list of ycbbenchmarks.com, 35 objects,
# and the YCB-Video subset, 21) agree with these numbers but for the skillet (951). A third, of 90 objects,
# differs on the mustard bottle (404), bleach cleanser (479), spoon (18), baseball (138), tennis ball (57),
# chain (100) and timer (101), and gives 20 for every cup; of the wine glass, small clamp and toy
# airplane no second copy was found. None: unknown, estimated from the volume. The fruits are hollow plastic.
# `functional` is read off the scans; where it is missing the labeller has to tell the ends apart.
OBJECTS: dict[str, YcbObject] = {
    "001_chips_can": _axial("chips_can", 205),
    "002_master_chef_can": _axial("can", 414),
    "003_cracker_box": _mirror("box", 411),
    "004_sugar_box": _mirror("box", 514),
    "005_tomato_soup_can": _axial("can", 349),
    "006_mustard_bottle": _mirror("bottle", 603),
    "007_tuna_fish_can": _axial("can", 171),
    "008_pudding_box": _mirror("box", 187),
    "009_gelatin_box": _mirror("box", 97),
    "010_potted_meat_can": _mirror("can", 370),
    "011_banana": _mirror("banana", 66, fill="shell"),
    "012_strawberry": _axial("strawberry", 18, fill="shell"),
    "013_apple": _axial("apple", 68, fill="shell"),
    "014_lemon": _mirror("lemon", 29, fill="shell"),
    "015_peach": _axial("peach", 33, fill="shell"),
    "016_pear": _axial("pear", 49, fill="shell"),
    "017_orange": _axial("orange", 47, fill="shell"),
    "018_plum": _axial("plum", 25, fill="shell"),
    "019_pitcher_base": _mirror("pitcher", 178, fill="shell"),
    "021_bleach_cleanser": _mirror("bottle", 1131),
    "022_windex_bottle": _mirror("bottle", 1022),
    "023_wine_glass": _axial("wine_glass", 133),
    "024_bowl": _axial("bowl", 147),
    "025_mug": _mirror("mug", 118),
    "026_sponge": _mirror("sponge", 6.2),
    "027_skillet": _tool("pan", 950),
    "028_skillet_lid": _mirror("pan_lid", 652),
    "029_plate": _axial("plate", 279),
    "030_fork": _tool("fork", 34, functional=(-1, 0, 0)),
    "031_spoon": _tool("spoon", 30),
    "032_knife": _tool("knife", 31, functional=(-1, 0, 0)),
    "033_spatula": _tool("spatula", 51.5),
    "035_power_drill": _tool("drill", 895, functional=(-1, 0, 0)),
    "036_wood_block": _mirror("box", 729),
    "037_scissors": _tool("scissor", 82, functional=(1, 2, 0)),
    "038_padlock": _mirror("padlock", 208),
    "040_large_marker": _tool("marker", 15.8),
    "041_small_marker": _tool("marker", 8.2),
    "042_adjustable_wrench": _tool("spanner", 252),
    "043_phillips_screwdriver": _tool("screwdriver", 97, functional=(-2, -1, 0)),
    "044_flat_screwdriver": _tool("screwdriver", 98.4),
    "048_hammer": _tool("hammer", 665),
    "049_small_clamp": _tool("clip", 19.2),
    "050_medium_clamp": _tool("clip", 59),
    "051_large_clamp": _tool("clip", 125),
    "052_extra_large_clamp": _tool("clip", 202),
    "053_mini_soccer_ball": _axial("ball", 123, fill="shell"),
    "054_softball": _axial("ball", 191),
    "055_baseball": _axial("ball", 148),
    "056_tennis_ball": _axial("tennis_ball", 58, fill="shell"),
    "057_racquetball": _axial("ball", 41, fill="shell"),
    "058_golf_ball": _axial("ball", 46),
    "059_chain": _mirror("chain", 98),
    "061_foam_brick": _mirror("brick", 28),
    "062_dice": _mirror("dice", 5.2),
    **{f"063-{letter}_marbles": _axial("marble") for letter in "abcdef"},
    **{
        f"065-{letter}_cups": _axial("cup", grams)
        for letter, grams in zip(
            "abcdefghij", (13, 14, 17, 19, 21, 26, 28, 31, 35, 38), strict=True
        )
    },
    **{f"070-{letter}_colored_wood_blocks": _mirror("box") for letter in "ab"},
    "071_nine_hole_peg_test": _mirror("peg_board", 1435),
    "072-a_toy_airplane": _mirror("toy_airplane", 570),
    **{f"072-{letter}_toy_airplane": _mirror("toy_airplane_part") for letter in "bcdefghijk"},
    **{f"073-{letter}_lego_duplo": _mirror("building_block") for letter in "abcdefghijklm"},
    "076_timer": _mirror("timer", 102),
    "077_rubiks_cube": _mirror("puzzle_cube", 94),
}


def items(path: Path) -> list[ScanItem]:
    """The objects at `path`: a folder of archives and unpacked objects, or a single one of either.

    An object that is there both ways is read from its unpacked folder.

    Raises:
      InputError: `path` does not exist or holds no YCB object.
    """
    if not path.exists():
        raise InputError(
            f"{path}: no such file or folder; expected YCB's *{SUFFIX} or their folder"
        )
    if path.is_file():
        if not path.name.endswith((".tgz", ".tar.gz")):
            raise InputError(f"{path}: not an archive; expected one named <id>{SUFFIX}")
        return [ScanItem(_archive_name(path), path)]
    if (path / MESH).is_file():
        return [ScanItem(path.resolve().name, path)]
    found = {_archive_name(p): p for p in path.glob(f"*{SUFFIX}")}
    found |= {p.parent.parent.name: p.parent.parent for p in path.glob(f"*/{MESH}")}
    if not found:
        raise InputError(f"{path}: holds no YCB object; expected *{SUFFIX} or <id>/{MESH}")
    return [ScanItem(name, found[name]) for name in sorted(found)]


def inputs(item: ScanItem) -> dict[str, str]:
    """The sha256 of every file that the object is built from, keyed by file name."""
    if item.path.is_file():
        return {item.path.name: sha256(item.path)}
    files = sorted(p for p in (item.path / MESH.parent).glob("text*") if p.is_file())
    return {p.name: sha256(p) for p in files}


@contextmanager
def opened(item: ScanItem) -> Iterator[Scan]:
    """Read one object; its texture stays there as long as the context does.

    Raises:
      InputError: The archive or the mesh in it cannot be used.
    """
    if item.path.is_dir():
        yield _scan(item, item.path, MESH)
        return
    found = collection.find(item.path, [f"*/{MESH}"])
    if len(found) != 1:
        raise InputError(f"{item.path}: holds {len(found)} meshes; expected one <id>/{MESH}")
    mesh = PurePosixPath(found[0])
    members = [mesh, mesh.with_name(TEXTURE), mesh.with_name(LIBRARY)]
    with collection.unpacked(item, members) as folder:
        yield _scan(item, folder, Path(mesh))


def _scan(item: ScanItem, folder: Path, member: Path) -> Scan:
    mesh = collection.load_mesh(replace(item, member=str(member)), folder)
    texture = (folder / member).with_name(TEXTURE)
    # Its only use: what it says must be what is taken anyway.
    library = read_materials(texture.with_name(LIBRARY), texture.parent)
    for material in library.values():
        if material.lacks:
            log.warning("%s: %s", texture.with_name(LIBRARY), material.lacks)
    if texture.is_file() and not any(m.texture == texture for m in library.values()):
        log.warning("%s: no material of %s has it; taken all the same", texture, LIBRARY)
    entry = OBJECTS.get(item.name) or _unlisted(item.name)
    return Scan(
        name=item.name,
        category=entry.category,
        object_type=entry.object_type,
        mesh=mesh,
        texture=texture if texture.is_file() else None,
        up=np.array([0.0, 0.0, 1.0]),
        mass=None if entry.grams is None else entry.grams / 1000,
        provenance=Provenance(SOURCE, item.name, LICENCE, inputs(item)),
        fill=entry.fill,
        functional=None if entry.functional is None else np.array(entry.functional, float),
    )


def _archive_name(path: Path) -> str:
    return re.sub(r"(_google_16k)?(\.tgz|\.tar\.gz)$", "", path.name)


def _unlisted(name: str) -> YcbObject:
    """`012-b_some_thing` -> what a `some_thing` is."""
    kind = kind_of(re.sub(r"^\d+(-[a-z])?_", "", name))
    return YcbObject(kind.category, kind.object_type)
