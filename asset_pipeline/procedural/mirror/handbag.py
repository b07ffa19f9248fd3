"""A handbag: a tapered body with a zip along the top and two handles, or one, standing up.

Real sizes: small to medium handbags are 180-300 mm wide, 130-200 mm tall without handles and 65-130 mm deep; handles
rise 60-110 mm; empty they weigh 0.25-0.6 kg. Front and back are alike, so half a turn about X, up, maps the bag onto
itself. Y is along its width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry.mass import solid_mass_properties
from asset_pipeline.procedural.pieces import AreaBox, Piece, placed, rigid_specimen
from asset_pipeline.procedural.revolution import convex_part
from asset_pipeline.procedural.solids import box, ellipse, loft, print_on_face, rounded_rectangle
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from asset_pipeline.procedural.swept import bar
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

EDGE = 0.008  # rounding of the lower and upper edges [m]
LEVELS = 9  # of the body between the roundings
BRASS: Colour = (0.80, 0.66, 0.30, 1.0)
DARK: Colour = (0.12, 0.11, 0.10, 1.0)


@dataclass(frozen=True)
class Handbag:
    """Sizes [m] and colours.

    Attributes: width and depth at the bottom; height of the body; narrow and thin, width and depth at the
    top as shares of those at the bottom; swell, share by which the sides bulge at half height; corner,
    radius of the upright edges; handles, one or two; rise, their height over the body; span, distance of
    their ends as a share of the width; thick, their diameter; mass [kg]; lower part's height as a share;
    colour, lower part's colour, handles' colour.
    """

    width: float = 0.260
    depth: float = 0.105
    height: float = 0.170
    narrow: float = 0.90
    thin: float = 0.62
    swell: float = 0.0
    corner: float = 0.022
    handles: int = 2
    rise: float = 0.085
    span: float = 0.46
    thick: float = 0.010
    mass: float = 0.42
    lower: float = 0.0
    colour: Colour = (0.50, 0.26, 0.14, 1.0)
    base: Colour = (0.36, 0.18, 0.10, 1.0)
    grips: Colour = (0.36, 0.18, 0.10, 1.0)

    def half(self, t: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n 2"]:
        """Half lengths along x and y at a share of the height."""
        taper = np.stack([1 + t * (self.narrow - 1), 1 + t * (self.thin - 1)], axis=-1)
        bulge = 1 + self.swell * (4 * t * (1 - t))
        return np.array([self.width, self.depth]) / 2 * taper * bulge[..., None]


# Body, lower part, handles.
_LEATHERS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.13, 0.13, 0.14, 1.0), (0.13, 0.13, 0.14, 1.0), (0.13, 0.13, 0.14, 1.0)),
    ((0.68, 0.14, 0.16, 1.0), (0.56, 0.10, 0.12, 1.0), (0.56, 0.10, 0.12, 1.0)),
    ((0.84, 0.76, 0.62, 1.0), (0.48, 0.30, 0.18, 1.0), (0.48, 0.30, 0.18, 1.0)),
    ((0.16, 0.24, 0.40, 1.0), (0.62, 0.42, 0.25, 1.0), (0.62, 0.42, 0.25, 1.0)),
    ((0.24, 0.40, 0.34, 1.0), (0.18, 0.30, 0.26, 1.0), (0.18, 0.30, 0.26, 1.0)),
    ((0.88, 0.62, 0.62, 1.0), (0.94, 0.90, 0.86, 1.0), (0.80, 0.50, 0.50, 1.0)),
    ((0.74, 0.48, 0.22, 1.0), (0.22, 0.16, 0.12, 1.0), (0.22, 0.16, 0.12, 1.0)),
)
# Narrowing, thinning, swelling: a satchel, a shopper, a doctor's bag, a dome.
_SHAPES = ((0.88, 0.60, 0.0), (1.10, 0.80, 0.0), (0.94, 0.78, 0.05), (0.72, 0.56, 0.10))


def design(index: int) -> Handbag:
    """The sizes of instance `index`; 0 is a brown satchel with two handles."""
    if index == 0:
        return Handbag()
    rng = specimen_rng("handbag", index)
    narrow, thin, swell = in_turn(index, _SHAPES)
    width = rng.uniform(0.180, 0.285) / max(narrow, 1.0)
    colour, base, grips = in_turn(index, _LEATHERS)
    return Handbag(
        width=round(float(width), 4),
        depth=round(float(width * rng.uniform(0.36, 0.46)), 4),
        height=round(float(min(width * rng.uniform(0.62, 0.80), 0.19)), 4),
        narrow=narrow,
        thin=thin,
        swell=swell,
        corner=uniform(rng, 0.012, 0.028),
        handles=1 if index % 3 == 2 else 2,
        rise=uniform(rng, 0.062, 0.098),
        span=round(float(rng.uniform(0.40, 0.52)), 3),
        thick=uniform(rng, 0.009, 0.013),
        mass=round(float(0.16 + width * rng.uniform(0.7, 1.3)), 3),
        lower=float(rng.choice((0.0, 0.28, 0.36))),
        colour=colour,
        base=base,
        grips=grips,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: width along x."""
    bag = design(index)
    _, y = bag.half(np.array(1.0))
    reach = bag.thick / 2 if bag.handles == 1 else y
    top = bag.height + bag.rise
    low = (-bag.span * bag.width / 4, -reach, top - bag.thick - 0.006)
    return rigid_specimen(
        "handbag",
        [_body(bag), *_handles(bag)],
        object_type="mirror",
        symmetry=SymmetryGroup.two_planes(),
        areas=(AreaBox("grip", low, (bag.span * bag.width / 4, reach, top)),),
    )


def _body(bag: Handbag) -> Piece:
    """Rings of rounded rectangles from bottom to top; what it holds is air, so its mass is given."""
    bend = np.linspace(0, np.pi / 2, 4)
    z = np.concatenate(
        [
            EDGE * (1 - np.cos(bend)),
            np.linspace(EDGE, bag.height - EDGE, LEVELS)[1:-1],
            bag.height - EDGE * (1 - np.cos(bend[::-1])),
        ]
    )
    inset = EDGE * (1 - np.sqrt(1 - np.clip(1 - np.minimum(z, bag.height - z) / EDGE, 0, 1) ** 2))
    half = bag.half(z / bag.height) - inset[:, None]
    corner = np.minimum(bag.corner, 0.6 * half[:, 1])
    rings = np.stack(
        [
            np.column_stack([rounded_rectangle((hx, hy), r, steps=5), np.full(24, height)])
            for (hx, hy), r, height in zip(half, corner, z, strict=True)
        ]
    )
    cut = int(np.searchsorted(z, bag.lower * bag.height)) if bag.lower else 0
    visuals = [Shape("mesh", mesh=loft(rings[cut:], caps=(cut == 0, True)), rgba=bag.colour)]
    if cut:
        visuals.append(
            Shape("mesh", mesh=loft(rings[: cut + 1], caps=(True, False)), rgba=bag.base)
        )
    top = bag.half(np.array(1.0))
    zip_half = (0.80 * top[0], 0.0045)
    lid = compose(np.eye(3), np.array([0.0, 0.0, bag.height]))
    visuals.append(
        Shape("mesh", mesh=print_on_face(rounded_rectangle(zip_half, 0.003), lid), rgba=DARK)
    )
    stops = [0, 3, 5, 3 + (LEVELS - 1) // 2, 9, 2 + LEVELS, len(rings) - 1]
    parts = [_frustum(rings[a], rings[b]) for a, b in zip(stops[:-1], stops[1:], strict=True)]
    mesh = loft(rings)
    return Piece(
        (*visuals, *_plates(bag)), tuple(parts), solid_mass_properties(mesh, 0.88 * bag.mass)
    )


def _frustum(low: Float[np.ndarray, "24 3"], high: Float[np.ndarray, "24 3"]) -> Shape:
    """Between two rings: the ends and the middles of their corners' arcs."""
    chosen = [
        k
        for corner in range(4)
        for k in (6 * corner, 6 * corner + 2, 6 * corner + 3, 6 * corner + 5)
    ]
    return convex_part(np.concatenate([low[chosen], high[chosen]]))


def _plates(bag: Handbag) -> list[Shape]:
    """A brass lock plate printed on either long side."""
    t = 0.72
    (_, y), (_, foot) = bag.half(np.array(t)), bag.half(np.array(t - 0.1))
    lean = np.arctan2(foot - y, 0.1 * bag.height)
    shapes = []
    for turn in (0.0, np.pi):
        upright = np.stack([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]], axis=1)
        facing = upright @ rotation_about(np.array([1.0, 0, 0]), -lean)
        pose = compose(facing, np.array([0.0, -y, t * bag.height]))
        pose = compose(rotation_about(np.array([0.0, 0, 1.0]), turn), np.zeros(3)) @ pose
        for outline, rgba, layer in (
            (rounded_rectangle((0.016, 0.011), 0.004), BRASS, 3),
            (ellipse((0.004, 0.005), 16), DARK, 4),
        ):
            shapes.append(Shape("mesh", mesh=print_on_face(outline, pose, layer), rgba=rgba))
    return shapes


def _handles(bag: Handbag) -> list[Piece]:
    """Arches that stand on the body's upper edge, with brass feet."""
    _, y = bag.half(np.array(1.0))
    offset = 0.0 if bag.handles == 1 else y - EDGE - 0.004
    half = bag.span * bag.width / 2
    angles = np.linspace(np.pi, 0, 33)
    rise = bag.rise - bag.thick / 2 + 0.004
    x = half * np.sign(np.cos(angles)) * np.abs(np.cos(angles)) ** (2 / 2.6)
    z = bag.height - 0.004 + rise * np.sin(angles).clip(0) ** (2 / 2.6)
    line = np.column_stack([x, np.zeros_like(x), z])
    section = np.tile([bag.thick / 2, bag.thick / 2], (len(line), 1))
    volume = np.pi * bag.thick**2 / 4 * (2 * rise + 2 * half)
    density = 0.12 * bag.mass / bag.handles / volume
    arch = bar(line, section, parts=8, rgba=bag.grips, density=density)
    foot = 0.75 * bag.thick
    feet = tuple(
        box(
            (side * half - foot, -foot, bag.height - 0.003),
            (side * half + foot, foot, bag.height + 0.008),
            BRASS,
        )
        for side in (-1.0, 1.0)
    )
    arch = Piece((*arch.visual, *feet), (*arch.collision, *feet), arch.mass)
    places = (0.0,) if bag.handles == 1 else (-offset, offset)
    return [placed(arch, compose(np.eye(3), np.array([0.0, at, 0.0]))) for at in places]
