"""A food container with a snap lid, shut.

Real sizes: clip-top boxes of 0.4-1.4 l are 120-220 mm long, 85-150 mm wide and 45-70 mm tall without their clips (shop
data of Lock & Lock and Rotho); walls taper by 2-5 degrees, lids overhang by 4-7 mm; empty 0.08-0.2 kg, with a meal
0.25-0.6 kg. Up is X; Y lies along the longer side, half a turn maps the shape onto itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.procedural.moulded import (
    facing,
    moulded,
    printed,
    rectangle,
    rounded_polygon,
    slab_loops,
)
from asset_pipeline.procedural.pieces import AreaBox, Piece, placed, rigid_specimen
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.poses import SymmetryGroup

CLIP = 0.0026  # thickness of a clip [m]
GASKET: Colour = (0.90, 0.90, 0.88, 1.0)


@dataclass(frozen=True)
class Container:
    """Sizes [m] and colours.

    Attributes: length and width of the lid; height of the whole; lid, its thickness; overhang of the lid over
    the box's upper edge; taper, by how much the foot is smaller on each side; corner, radius of the outline;
    clips, on the two short sides or on all four; clip, their width as a share of the side; density [kg/m^3],
    of box and content together; box's, lid's and clips' colours.
    """

    length: float = 0.150
    width: float = 0.105
    height: float = 0.058
    lid: float = 0.011
    overhang: float = 0.005
    taper: float = 0.006
    corner: float = 0.020
    clips: int = 4
    clip: float = 0.46
    density: float = 330.0
    body: Colour = (0.84, 0.88, 0.90, 1.0)
    top: Colour = (0.16, 0.50, 0.70, 1.0)
    latch: Colour = (0.22, 0.58, 0.78, 1.0)


_CLEAR: Colour = (0.86, 0.89, 0.90, 1.0)
# Box, lid, clips.
_COLOURS: tuple[tuple[Colour, Colour, Colour], ...] = (
    (_CLEAR, (0.86, 0.30, 0.24, 1.0), (0.78, 0.24, 0.19, 1.0)),
    (_CLEAR, (0.55, 0.74, 0.30, 1.0), (0.47, 0.66, 0.24, 1.0)),
    ((0.92, 0.90, 0.86, 1.0), (0.30, 0.31, 0.33, 1.0), (0.40, 0.41, 0.43, 1.0)),
    ((0.95, 0.83, 0.45, 1.0), (0.95, 0.95, 0.93, 1.0), (0.95, 0.95, 0.93, 1.0)),
    (_CLEAR, (0.94, 0.94, 0.93, 1.0), (0.30, 0.52, 0.72, 1.0)),
    ((0.62, 0.80, 0.80, 1.0), (0.16, 0.42, 0.44, 1.0), (0.16, 0.42, 0.44, 1.0)),
    (_CLEAR, (0.52, 0.36, 0.62, 1.0), (0.62, 0.46, 0.72, 1.0)),
)


def design(index: int) -> Container:
    """The sizes of instance `index`; 0 holds 0.6 l and has a clip on every side."""
    if index == 0:
        return Container()
    rng = specimen_rng("container", index)
    width = uniform(rng, 0.072, 0.125)
    length = round(min(width * float(rng.uniform(1.25, 1.9)), 0.20), 4)
    height = uniform(rng, 0.042, 0.066)
    mass = length * width * height * float(rng.uniform(200.0, 330.0)) + 0.03
    return Container(
        length,
        width,
        height,
        lid=uniform(rng, 0.009, 0.013),
        overhang=uniform(rng, 0.004, 0.007),
        taper=uniform(rng, 0.003, 0.008),
        corner=uniform(rng, 0.012, 0.028),
        clips=4 if index % 3 else 2,
        clip=uniform(rng, 0.34, 0.56),
        density=round(mass / (0.86 * length * width * height), 0),
        **dict(zip(("body", "top", "latch"), in_turn(index, _COLOURS), strict=True)),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: length along x, standing on z = 0."""
    item = design(index)
    x, y = item.length / 2, item.width / 2
    grips = [
        AreaBox("grip", np.minimum(a, b), np.maximum(a, b))
        for a, b in (((s * 0.55 * x, -y, 0.0), (s * x, y, item.height)) for s in (-1.0, 1.0))
    ]
    return rigid_specimen(
        "container",
        [_box(item), _lid(item), *_clips(item)],
        object_type="mirror",
        symmetry=SymmetryGroup.two_planes(),
        areas=grips,
    )


def _box(item: Container) -> Piece:
    """Tapered, massive: what is in it is in its density."""
    x, y = item.length / 2 - item.overhang, item.width / 2 - item.overhang
    high = item.height - item.lid
    loops = slab_loops(rectangle(x, y), item.corner, 0.0, high, edges=(0.006, 0.0), steps=7)
    narrower = item.taper * (1 - loops[..., 2] / high)
    loops[..., 0] *= 1 - narrower / x
    loops[..., 1] *= 1 - narrower / y
    return moulded(loops, ((1.0, item.body),), density=item.density)


def _lid(item: Container) -> Piece:
    """The lid, with a rim around a sunken panel, drawn as prints."""
    x, y, top = item.length / 2 - CLIP, item.width / 2 - CLIP, item.height
    radius = item.corner + item.overhang - CLIP
    loops = slab_loops(rectangle(x, y), radius, top - item.lid, top, edges=(0.0015, 0.003), steps=7)
    prints = []
    for inset, rgba, layer in (
        (0.010, item.latch, 1),
        (0.0115, item.top, 2),
        (0.020, item.latch, 3),
        (0.021, item.top, 4),
    ):
        outline = rounded_polygon(rectangle(x, y), radius, inset=inset, steps=6)
        prints.append(printed(outline, facing((0, 0, 1), (0, 0, top), up=(0, 1, 0)), rgba, layer))
    bands = ((0.16, GASKET), (1.0, item.top))
    return moulded(loops, bands, density=900.0 * 0.35, prints=prints)


def _clips(item: Container) -> list[Piece]:
    """Flaps hinged to the lid and snapped under the box's rim, each with a grip rib."""
    x, y = item.length / 2, item.width / 2
    low, high = item.height - 2.1 * item.lid, item.height - 0.10 * item.lid
    pieces = []
    for k in range(4):
        along_x = k % 2 == 0
        if not along_x and item.clips == 2:
            continue
        side = 1.0 if k < 2 else -1.0
        reach, other = (x, y) if along_x else (y, x)
        half = item.clip * other
        normal = np.array([side, 0, 0]) if along_x else np.array([0, side, 0])
        face = facing(normal, (reach - CLIP - 0.001) * normal + [0, 0, (low + high) / 2])
        loops = slab_loops(
            rectangle(half, (high - low) / 2), 0.004, 0.0, CLIP + 0.001, edges=(0.0, 0.0012)
        )
        clip = moulded(loops, ((1.0, item.latch),), density=900.0)
        rib = printed(
            rounded_polygon(rectangle(0.8 * half, 0.0011), 0.001),
            facing((0, 0, 1), (0, -0.25 * (high - low), CLIP + 0.001), up=(0, 1, 0)),
            item.top,
            3,
        )
        pieces.append(placed(Piece((*clip.visual, rib), clip.collision, clip.mass), face))
    return pieces
