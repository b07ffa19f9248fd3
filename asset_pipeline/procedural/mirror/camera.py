"""A camera: compact, rangefinder or single-lens reflex, alike on its left and right.

Real sizes: compact cameras are 95-110 x 56-65 x 24-32 mm and 0.2-0.3 kg, rangefinders 115-140 x 66-80 x 30-36 mm,
small reflex bodies 122-140 x 88-100 x 40-48 mm and 0.35-0.5 kg; their lenses are 42-68 mm thick and stand out by
22-60 mm. Dials and grips are on both sides, so that one plane mirrors the shape. Up is X; the lens reaches out, so by
the rule of the bulge it is on Y's side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry.mass import solid_mass_properties
from asset_pipeline.procedural.pieces import AreaBox, Piece, placed, rigid_specimen, solid_piece
from asset_pipeline.procedural.revolution import convex_part
from asset_pipeline.procedural.solids import (
    box,
    ellipse,
    loft,
    print_on_face,
    rounded_box_bands,
    rounded_rectangle,
)
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng
from asset_pipeline.procedural.tool_handles import ALONG_X
from asset_pipeline.procedural.turned import turned
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup, compose

LENS_SHARE = 0.5  # of the body's density: tubes with air between the glasses
BLACK: Colour = (0.10, 0.10, 0.11, 1.0)
GLASS: Colour = (0.10, 0.13, 0.26, 1.0)
SILVER: Colour = (0.76, 0.77, 0.78, 1.0)
FRONT = compose(
    np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.zeros(3)
)  # T_body_face, z along x
BACK = compose(np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]]), np.zeros(3))
Style = Literal["compact", "rangefinder", "reflex"]


@dataclass(frozen=True)
class Camera:
    """Sizes [m] and colours.

    Attributes: style; width, height and depth of the body; edge, rounding; lens, radius; reach of the lens
    in front of the body; steps, its radius at the front as a share; grip, by how much the sides bulge
    forwards; hump, height of what is on top in the middle; dial, radius; density of the whole [kg/m^3];
    covering's, plates' and lens's colours.
    """

    style: Style = "reflex"
    width: float = 0.128
    height: float = 0.080
    depth: float = 0.042
    edge: float = 0.005
    lens: float = 0.032
    reach: float = 0.046
    steps: float = 0.94
    grip: float = 0.010
    hump: float = 0.019
    dial: float = 0.009
    density: float = 780.0
    covering: Colour = (0.13, 0.13, 0.14, 1.0)
    plates: Colour = (0.19, 0.19, 0.20, 1.0)
    barrel: Colour = (0.12, 0.12, 0.13, 1.0)


# Covering, plates, lens.
_COLOURS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.15, 0.14, 0.14, 1.0), SILVER, SILVER),
    ((0.45, 0.26, 0.15, 1.0), SILVER, SILVER),
    ((0.66, 0.12, 0.13, 1.0), (0.66, 0.12, 0.13, 1.0), SILVER),
    ((0.15, 0.15, 0.16, 1.0), (0.20, 0.20, 0.22, 1.0), BLACK),
    ((0.92, 0.92, 0.91, 1.0), (0.92, 0.92, 0.91, 1.0), (0.30, 0.31, 0.33, 1.0)),
    ((0.16, 0.27, 0.46, 1.0), (0.16, 0.27, 0.46, 1.0), BLACK),
    ((0.24, 0.32, 0.26, 1.0), (0.70, 0.69, 0.66, 1.0), BLACK),
)
_STYLES: tuple[Style, ...] = ("rangefinder", "compact", "reflex")


def design(index: int) -> Camera:
    """The sizes of instance `index`; 0 is a small reflex camera, the styles take turns after it."""
    if index == 0:
        return Camera()
    rng = specimen_rng("camera", index)
    style: Style = in_turn(index, _STYLES)
    # Width, height, depth, edge, lens, reach, steps, grip, hump, dial, density.
    low, high = {
        "compact": (
            (0.094, 0.055, 0.024, 0.004, 0.019, 0.018, 0.80, 0, 0.003, 0.006, 950.0),
            (0.110, 0.065, 0.032, 0.007, 0.026, 0.032, 0.92, 0, 0.005, 0.008, 1150.0),
        ),
        "rangefinder": (
            (0.114, 0.064, 0.030, 0.004, 0.023, 0.024, 0.86, 0, 0.004, 0.008, 800.0),
            (0.136, 0.076, 0.036, 0.008, 0.029, 0.040, 0.96, 0, 0.008, 0.010, 950.0),
        ),
        "reflex": (
            (0.116, 0.074, 0.036, 0.004, 0.029, 0.038, 0.88, 0.006, 0.015, 0.008, 600.0),
            (0.138, 0.090, 0.045, 0.007, 0.035, 0.058, 1.00, 0.012, 0.023, 0.010, 750.0),
        ),
    }[style]
    sizes = [round(float(value), 4) for value in rng.uniform(low, high)]
    covering, plates, barrel = in_turn(index, _COLOURS)
    return Camera(style, *sizes, covering=covering, plates=plates, barrel=barrel)


def generate(index: int = 0) -> Specimen:
    """Instance `index`: lens along +x, the body's middle at the origin."""
    camera = design(index)
    x, y, z = camera.depth / 2, camera.width / 2, camera.height / 2
    pieces = [_body(camera), _lens(camera), _top(camera)]
    pieces += [_dial(camera, side) for side in (-1.0, 1.0)]
    if camera.grip:
        pieces += [_grip(camera, side) for side in (-1.0, 1.0)]
    sides = [((-x, s * 0.62 * y, -z), (x + camera.grip, s * y, z)) for s in (-1.0, 1.0)]
    return rigid_specimen(
        "camera",
        pieces,
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        areas=tuple(AreaBox("grip", np.minimum(a, b), np.maximum(a, b)) for a, b in sides),
    )


def _body(camera: Camera) -> Piece:
    half = np.array([camera.depth, camera.width, camera.height]) / 2
    low, high = -0.62 * half[2], 0.52 * half[2]
    bands = rounded_box_bands((half[0], half[1], half[2]), camera.edge, (low, high))
    colours = (camera.plates, camera.covering, camera.plates)
    visuals = [Shape("mesh", mesh=m, rgba=c) for m, c in zip(bands, colours, strict=True)]
    (closed,) = rounded_box_bands((half[0], half[1], half[2]), camera.edge)
    screen = compose(BACK[:3, :3], np.array([-half[0], 0.0, -0.12 * half[2]]))
    visuals += [
        _print(rounded_rectangle((0.52 * half[1], 0.62 * half[2]), 0.003), screen, BLACK),
        _print(rounded_rectangle((0.47 * half[1], 0.54 * half[2]), 0.001), screen, GLASS, 2),
    ]
    window_z = 0.74 * half[2]
    for side in (-1.0, 1.0):  # viewfinder and flash windows
        at = compose(FRONT[:3, :3], np.array([half[0], 0.62 * side * half[1], window_z]))
        visuals.append(
            _print(rounded_rectangle((0.009, 0.16 * half[2]), 0.001), at, (0.72, 0.74, 0.74, 1.0))
        )
    mass = solid_mass_properties(closed, camera.density * float(closed.volume))
    return Piece(tuple(visuals), (_chamfered(half, camera.edge),), mass)


def _print(outline: np.ndarray, pose: np.ndarray, rgba: Colour, layer: int = 1) -> Shape:
    return Shape("mesh", mesh=print_on_face(outline, pose, 2 * layer), rgba=rgba)


def _chamfered(half: Float[np.ndarray, "3"], edge: float) -> Shape:
    """A box whose edges are cut a little outside their rounding."""
    rings = []
    for z, inset in ((-1.0, 0.6), (-1.0, 0.0), (1.0, 0.0), (1.0, 0.6)):
        at = half[:2] - inset * edge
        outline = rounded_rectangle((at[0], at[1]), 0.6 * edge, steps=1)
        height = z * (half[2] - (0.0 if inset else 0.6 * edge))
        rings.append(np.column_stack([outline, np.full(len(outline), height)]))
    return convex_part(np.concatenate(rings))


def _lens(camera: Camera) -> Piece:
    """Mount, ribbed barrel and front ring, along x from the body's front; dark glass at its end."""
    r, length = camera.lens, camera.reach
    ribs = [
        (r - 0.0006 * (k % 4 > 1), z) for k, z in enumerate(np.linspace(0.42, 0.66, 20) * length)
    ]
    front = camera.steps * r
    corners = [(0, -0.002), (r + 0.002, -0.002), (r + 0.002, 0.0025), (r, 0.003), *ribs]
    corners += [(r, 0.68 * length), (front, 0.76 * length), (front, length - 0.001)]
    corners += [(front - 0.001, length), (0, length + 0.0001)]
    bands = (
        (0.0027, SILVER),
        (0.40 * length, camera.barrel),
        (0.67 * length, BLACK),
        (length, camera.barrel),
    )
    levels = (-0.002, 0.0024, 0.003, 0.68 * length, 0.76 * length, length - 0.001)
    piece = turned(
        np.array(corners), levels, bands=bands, density=LENS_SHARE * camera.density, sections=48
    )
    face = compose(np.eye(3), np.array([0.0, 0.0, length]))
    prints = tuple(
        _print(ellipse((share * front, share * front), 32), face, rgba, layer)
        for share, rgba, layer in (
            (0.90, BLACK, 1),
            (0.66, GLASS, 2),
            (0.20, (0.42, 0.5, 0.72, 1.0), 3),
        )
    )
    piece = Piece((*piece.visual, *prints), piece.collision, piece.mass)
    # Clear of what the camera stands on.
    low = max(-0.08 * camera.height, r + 0.007 - camera.height / 2)
    at = np.array([camera.depth / 2, 0.0, low])
    return placed(piece, compose(ALONG_X[:3, :3], at))


def _top(camera: Camera) -> Piece:
    """The hump over the lens: a reflex camera's prism housing, else a low plate; a flash shoe on it."""
    half = np.array([camera.depth, 0.36 * camera.width]) / 2
    top = 0.62 if camera.style == "reflex" else 0.94
    z = camera.height / 2
    rings = []
    for share, height in ((1.0, z - 0.002), (0.97, z + 0.25 * camera.hump), (top, z + camera.hump)):
        outline = rounded_rectangle((0.92 * half[0], share * half[1]), 0.003, steps=2)
        rings.append(np.column_stack([outline, np.full(len(outline), height)]))
    loops = np.stack(rings)
    parts = [convex_part(loops[k : k + 2].reshape(-1, 3)) for k in range(2)]
    hump = solid_piece(loft(loops), parts, rgba=camera.plates, density=camera.density)
    shoe = box(
        (-0.009, -0.009, z + camera.hump - 0.001), (0.009, 0.009, z + camera.hump + 0.002), SILVER
    )
    return Piece((*hump.visual, shoe), (*hump.collision, shoe), hump.mass)


def _dial(camera: Camera, side: float) -> Piece:
    """A knurled dial with a button on it."""
    r, height = camera.dial, 0.005
    rim = [(r - 0.0005 * (k % 2), z) for k, z in enumerate(np.linspace(0.0, height, 8))]
    profile = np.array(
        [
            (0, -0.001),
            (r, -0.001),
            *rim,
            (0.55 * r, height + 0.0001),
            (0.5 * r, height + 0.002),
            (0, height + 0.0022),
        ]
    )
    dial = turned(
        profile,
        (-0.001, height, height + 0.0002, height + 0.002),
        bands=((height, SILVER if camera.plates != SILVER else BLACK), (1.0, SILVER)),
        density=camera.density,
        sections=24,
    )
    at = np.array([0.0, 0.70 * side * camera.width / 2, camera.height / 2])
    return placed(dial, compose(np.eye(3), at))


def _grip(camera: Camera, side: float) -> Piece:
    """A rubber bulge at the front of one side."""
    x, y, z = camera.depth / 2, camera.width / 2, 0.86 * camera.height / 2
    middle = 0.80 * y
    half = (camera.grip, 0.17 * y)
    rings = []
    for height, share in ((-z, 0.85), (-0.8 * z, 1.0), (0.6 * z, 1.0), (0.9 * z, 0.7)):
        outline = rounded_rectangle((share * half[0], half[1]), 0.5 * share * half[0], steps=2)
        outline = outline + [x, side * middle]
        rings.append(np.column_stack([outline, np.full(len(outline), height)]))
    loops = np.stack(rings)
    parts = [convex_part(loops[k : k + 2].reshape(-1, 3)) for k in range(3)]
    return solid_piece(loft(loops), parts, rgba=camera.covering, density=0.5 * camera.density)
