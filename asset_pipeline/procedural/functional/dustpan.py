"""A dustpan: a tray with three walls, a lip in front and a straight handle at its back.

Typical sizes, from general knowledge and not from a data sheet: trays are 190-240 mm wide and
130-180 mm deep, walls 40-60 mm high at the back and sloping to the front, 2-2.5 mm of plastic; with
the handle 270-340 mm long; 130-220 g. X runs along the handle towards the tray; the origin is where
the handle meets the back wall. Y points up: the tray hangs below its handle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
import trimesh
from jaxtyping import Float

from asset_pipeline.procedural.extruded import panel
from asset_pipeline.procedural.pieces import Piece, solid_piece
from asset_pipeline.procedural.revolution import convex_part, fillet
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import loft_outwards
from asset_pipeline.procedural.tool import tool_specimen
from asset_pipeline.procedural.tool_handles import handle, loop_hulls, superellipse

PLASTIC, RUBBER = 1020.0, 1150.0  # [kg/m^3]
HOLLOW = 520.0  # a handle's plastic and the air in it, on average [kg/m^3]
LIP = 0.013  # length of the lip in front of the floor [m]
FLARE = 0.004  # the walls' tops are farther out by this [m]
RIBS = 5

_COLOURS: tuple[tuple[Colour, Colour], ...] = (
    ((0.20, 0.55, 0.36, 1.0), (0.16, 0.17, 0.18, 1.0)),
    ((0.80, 0.17, 0.15, 1.0), (0.18, 0.18, 0.19, 1.0)),
    ((0.70, 0.72, 0.74, 1.0), (0.90, 0.55, 0.14, 1.0)),
    ((0.93, 0.75, 0.18, 1.0), (0.22, 0.24, 0.26, 1.0)),
    ((0.45, 0.30, 0.55, 1.0), (0.88, 0.86, 0.90, 1.0)),
    ((0.90, 0.90, 0.88, 1.0), (0.20, 0.50, 0.62, 1.0)),
)


@dataclass(frozen=True)
class Dustpan:
    """Sizes [m] and colours.

    Attributes: width of the tray in front; taper, how much narrower it is at the back; depth, from the
    back wall to the lip; drop of the floor's underside below the handle's line; top of the back wall
    above that line; low, height of the walls in front; corner, radius at the back; wall, thickness;
    grip, length of the handle; thick, its width; tray and accent (handle's end, lip), colours.
    """

    width: float = 0.215
    taper: float = 0.030
    depth: float = 0.165
    drop: float = 0.040
    top: float = 0.013
    low: float = 0.008
    corner: float = 0.030
    wall: float = 0.0024
    grip: float = 0.120
    thick: float = 0.026
    tray: Colour = (0.16, 0.40, 0.66, 1.0)
    accent: Colour = (0.20, 0.21, 0.23, 1.0)


def design(index: int) -> Dustpan:
    """The sizes of instance `index`; 0 is a household one."""
    if index == 0:
        return Dustpan()
    rng = specimen_rng("dustpan", index)
    tray, accent = in_turn(index, _COLOURS)
    return Dustpan(
        width=uniform(rng, 0.185, 0.235),
        taper=uniform(rng, 0.0, 0.050),
        depth=uniform(rng, 0.130, 0.180),
        drop=uniform(rng, 0.033, 0.047),
        top=uniform(rng, 0.012, 0.015),
        low=uniform(rng, 0.005, 0.020),
        corner=uniform(rng, 0.014, 0.042),
        wall=uniform(rng, 0.0022, 0.0026),
        grip=uniform(rng, 0.105, 0.145),
        thick=uniform(rng, 0.022, 0.028),
        tray=tray,
        accent=accent,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, lying on its floor, its handle along x."""
    dustpan = design(index)
    return tool_specimen(
        "dustpan",
        [_walls(dustpan), *_floor(dustpan), _handle(dustpan)],
        joint=(0.0, 0.0, 0.0),
        mirror_normal="y",
    )


def _path(dustpan: Dustpan) -> Float[np.ndarray, "n 2"]:
    """The walls' outer foot in the xy plane, from the front on -y around the back to the front on +y."""
    front, back = dustpan.width / 2, (dustpan.width - dustpan.taper) / 2
    x = dustpan.depth - LIP
    corners = np.array([[x, -front], [0.0, -back], [0.0, back], [x, front]])
    radius = dustpan.corner
    return fillet(corners, {1: radius, 2: radius}, 8)


def _walls(dustpan: Dustpan) -> Piece:
    """One strip around three sides; its top slopes down to the front in a gentle curve."""
    path = _path(dustpan)
    # Stations along the straight sides, to follow the top's curve.
    side = np.linspace(path[0], path[1], 9)[:-1]
    path = np.concatenate([side, path[1:-1], side[::-1] * [1, -1]])
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    outwards = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    outwards[:, 0] = np.where(path[:, 0] == path[:, 0].max(), 0.0, outwards[:, 0])
    floor = -dustpan.drop
    share = np.clip(path[:, 0] / (dustpan.depth - LIP), 0, 1)
    fall = share**1.6
    top = (1 - fall) * dustpan.top + fall * (floor + dustpan.low)
    lean = FLARE * (top - floor) / (dustpan.top - floor)
    t = dustpan.wall
    # In the order of a loop: outer foot, outer top, inner top, inner foot.
    offsets = ((0 * top, floor), (lean, top), (lean - t, top), (0 * top - t, floor))
    loops = np.stack(
        [
            np.column_stack([path + out[:, None] * outwards, np.broadcast_to(z, top.shape)])
            for out, z in offsets
        ],
        axis=1,
    )
    return solid_piece(loft_outwards(loops), loop_hulls(loops), rgba=dustpan.tray, density=PLASTIC)


def _floor(dustpan: Dustpan) -> list[Piece]:
    """The plate, its ribs, and the rubber lip that thins out to the front."""
    low, t = -dustpan.drop, dustpan.wall
    path = _path(dustpan)
    plate = panel(shapely.Polygon(path), low, low + t, rgba=dustpan.tray, density=PLASTIC)
    back, front = path[0, 0] - 0.002, dustpan.depth
    y = dustpan.width / 2
    corners = [(x, side * y, z) for side in (-1, 1) for x, z in ((back, low), (front, low))]
    corners += [(back, s * y, low + 1.2 * t) for s in (-1, 1)]
    corners += [(front, s * y, low + 0.001) for s in (-1, 1)]
    edge = convex_part(np.array(corners))
    assert edge.mesh is not None
    lip = solid_piece(edge.mesh, [edge], rgba=dustpan.accent, density=RUBBER)
    pieces = [plate, lip]
    for across in np.linspace(-0.62, 0.62, RIBS) * (dustpan.width - dustpan.taper) / 2:
        rib = trimesh.creation.box(
            bounds=[
                [0.18 * front, across - 0.001, low],
                [0.80 * front, across + 0.001, low + t + 6e-4],
            ]
        )
        pieces.append(solid_piece(rib, [], rgba=dustpan.accent, density=0.2 * PLASTIC))
    return pieces


def _handle(dustpan: Dustpan) -> Piece:
    n, y, z = dustpan.grip, dustpan.thick / 2, 0.38 * dustpan.thick
    table = [(-n, 0.86 * y, 0.90 * z), (-0.85 * n, y, z), (-0.5 * n, 0.90 * y, 1.05 * z)]
    table += [(-0.12 * n, 0.84 * y, z), (0.001, 0.84 * y, z)]
    return handle(
        table,
        [(-0.80 * n, dustpan.accent), (0.0, dustpan.tray)],
        density=HOLLOW,
        outline=superellipse(2.8),
        rounding=(0.006, 0.0),
    )
