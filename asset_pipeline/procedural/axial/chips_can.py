"""A can of stacked potato chips: paper tube, plastic lid, metal bottom.

Real sizes. The YCB chips can is 75 mm wide, 250 mm tall and weighs 205 g (Calli et al., "Benchmarking
in Manipulation Research", IEEE RAM 2015, object list). Chips tubes are sold in few diameters, near
66 mm for the snack sizes and 75 mm for the large ones, and in heights from 150 mm to 255 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asset_pipeline.geometry.mass import combine
from asset_pipeline.procedural.revolution import fillet, lathe, revolved_mass
from asset_pipeline.procedural.solids import ellipse, print_on_cylinder
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.assets.geometry import Body, MassProperties, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup

YCB_MASS = 0.205  # [kg], with its chips
PAPER, STEEL, POLYETHYLENE = 750.0, 7850.0, 930.0  # [kg/m^3]
# Without rolling friction a lying can would roll for ever; its chips shift and soon stop it.
FRICTION = (0.8, 0.005, 0.001)
METAL: Colour = (0.74, 0.75, 0.77, 1.0)
CREAM: Colour = (0.97, 0.95, 0.88, 1.0)


@dataclass(frozen=True)
class ChipsCan:
    """Sizes [m] and colours. The lid and the bottom rim are the widest parts, by `step`.

    Attributes: diameter and height, over all; body, band, emblem and lid colours.
    """

    diameter: float = 0.075
    height: float = 0.250
    body: Colour = (0.80, 0.07, 0.09, 1.0)
    band: Colour = (0.98, 0.79, 0.15, 1.0)
    lid: Colour = (0.93, 0.93, 0.91, 1.0)
    step: float = 0.0004
    rim: float = 0.005
    lid_height: float = 0.011
    tube_wall: float = 0.0016


_FLAVOURS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.10, 0.45, 0.22, 1.0), (0.93, 0.90, 0.72, 1.0), (0.16, 0.42, 0.25, 1.0)),
    ((0.10, 0.25, 0.62, 1.0), (0.88, 0.89, 0.93, 1.0), (0.90, 0.91, 0.93, 1.0)),
    ((0.93, 0.52, 0.08, 1.0), (0.60, 0.10, 0.08, 1.0), (0.93, 0.93, 0.91, 1.0)),
    ((0.42, 0.16, 0.48, 1.0), (0.95, 0.80, 0.30, 1.0), (0.30, 0.12, 0.36, 1.0)),
)


def design(index: int) -> ChipsCan:
    """The sizes of instance `index`; 0 is the YCB chips can."""
    if index == 0:
        return ChipsCan()
    rng = specimen_rng("chips_can", index)
    body, band, lid = in_turn(index, _FLAVOURS)
    return ChipsCan(
        diameter=uniform(rng, 0.066, 0.076),
        height=round(float(rng.uniform(0.150, 0.255)), 3),
        body=body,
        band=band,
        lid=lid,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the can."""
    can = design(index)
    radius, half = can.diameter / 2, can.height / 2
    body = Body(
        name="chips_can",
        collision=(Shape("cylinder", (radius, half)),),
        visual=_visuals(can),
        mass_properties=_mass(can),
        friction=FRICTION,
    )
    label = PoseLabel(
        origin=np.zeros(3),
        # X is the axis, from the bottom to the lid; Y lies along x of the frame, through the emblem.
        rotation=np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
        object_type="axial",
        extents=np.array([can.height, can.diameter, can.diameter]),
        symmetry=SymmetryGroup.about_x(),
    )
    return Specimen(label, (body,))


def _visuals(can: ChipsCan) -> tuple[Shape, ...]:
    r, tube, half = can.diameter / 2, can.diameter / 2 - can.step, can.height / 2
    seam, lid = -half + can.rim, half - can.lid_height
    length = lid - seam
    bands = seam + length * np.array([0.0, 0.10, 0.13, 0.84, 0.87, 1.0])
    colours = (can.band, CREAM, can.body, CREAM, can.band)
    bottom = np.array(
        [[0, -half + 0.0012], [r - 0.0032, -half + 0.0012], [r - 0.0024, -half], [r, -half]]
        + [[r, seam], [tube, seam]]
    )
    top = np.array(
        [[tube, lid], [r, lid], [r, half], [r - 0.003, half], [r - 0.0042, half - 0.0012]]
        + [[0, half - 0.0012]]
    )
    shapes = [
        _turned(fillet(bottom, {3: 0.001, 4: 0.001}, 4), METAL),
        _turned(fillet(top, {2: 0.0014, 3: 0.0006}, 5), can.lid),
    ]
    for low, high, rgba in zip(bands[:-1], bands[1:], colours, strict=True):
        shapes.append(_turned(np.array([[tube, low], [tube, high]]), rgba))
    middle = seam + 0.58 * length
    emblem = ellipse((0.62 * r, 0.72 * r))
    for angle in (0.0, np.pi):
        for layer, (scale, rgba) in enumerate(((1.0, CREAM), (0.86, can.band)), start=1):
            mesh = print_on_cylinder(scale * emblem, tube, angle=angle, height=middle, layer=layer)
            shapes.append(Shape("mesh", mesh=mesh, rgba=rgba))
    return tuple(shapes)


def _turned(profile: np.ndarray, rgba: Colour) -> Shape:
    return Shape("mesh", mesh=lathe(profile, sections=96), rgba=rgba)


def _mass(can: ChipsCan) -> MassProperties:
    """Tube, bottom, lid, and chips of even density in between; the YCB can's 205 g set theirs."""
    empty, chips = _packaging_and_content(can)
    _, reference = _packaging_and_content(ChipsCan())
    density = (YCB_MASS - _packaging_and_content(ChipsCan())[0].mass) / reference.mass
    content = MassProperties(chips.mass * density, chips.center_of_mass, chips.inertia * density)
    return combine([empty, content])


def _packaging_and_content(can: ChipsCan) -> tuple[MassProperties, MassProperties]:
    """The packaging, and the content at a density of 1 kg/m^3."""
    r, wall, half = can.diameter / 2, can.tube_wall, can.height / 2
    steel, film = 0.0003, 0.0012

    def disc(radius: float, low: float, high: float, inner: float = 0.0) -> np.ndarray:
        return np.array([[inner, low], [radius, low], [radius, high], [inner, high]])

    packaging = [
        revolved_mass(disc(r - can.step, -half, half - film, r - can.step - wall), PAPER),
        revolved_mass(disc(r - wall, -half + 0.001, -half + 0.001 + steel), STEEL),
        revolved_mass(disc(r, half - film, half), POLYETHYLENE),
        revolved_mass(disc(r, half - can.lid_height, half - film, r - can.step), POLYETHYLENE),
    ]
    inside = disc(r - can.step - wall, -half + 0.0015, half - 0.010)
    return combine(packaging), revolved_mass(inside, 1.0)
