"""A stoneware bowl on a foot ring.

Real sizes. Cereal and rice bowls are 120-170 mm wide and 45-75 mm tall with walls of 3-5 mm (the YCB bowl:
159 mm wide, 53 mm tall, Calli et al. 2015; the Akita bowl of Google Scanned Objects, measured: 159 mm
wide, 75 mm tall, wall 4.5-5.5 mm, foot ring 69 mm wide outside and 61 mm inside).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry import Body, MassProperties, Shape
from asset_pipeline.labelling.label import PoseLabel
from asset_pipeline.procedural.revolution import fillet, lathe, revolved_mass, wall_wedges
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng
from manipose_mj.poses import SymmetryGroup

STONEWARE = 2300.0  # [kg/m^3]
WEDGES = 16  # of each of two rings of wall
CURVE_POINTS = 24
JOINT = 11  # the curve's point between the rings: there the parts' errors are alike
RECESS = 0.0013  # under the foot [m]; its collision disc is flat


@dataclass(frozen=True)
class Bowl:
    """Sizes [m] and colours.

    Attributes: diameter, before the lip is rounded; height, over all; wall; foot, outer diameter of the foot ring; ring, its
    height; bend, where the wall's curve turns up (two shares; 1, 0 would be an edge); colours of
    the outside, the inside and the rim.
    """

    diameter: float = 0.150
    height: float = 0.060
    wall: float = 0.0042
    foot: float = 0.068
    ring: float = 0.006
    bend: tuple[float, float] = (0.66, 0.22)
    outside: Colour = (0.20, 0.40, 0.55, 1.0)
    inside: Colour = (0.94, 0.93, 0.89, 1.0)
    rim: Colour = (0.45, 0.30, 0.20, 1.0)


_GLAZES: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.93, 0.92, 0.88, 1.0), (0.93, 0.92, 0.88, 1.0), (0.20, 0.33, 0.58, 1.0)),
    ((0.72, 0.20, 0.15, 1.0), (0.95, 0.90, 0.80, 1.0), (0.95, 0.90, 0.80, 1.0)),
    ((0.18, 0.19, 0.21, 1.0), (0.30, 0.32, 0.35, 1.0), (0.55, 0.40, 0.25, 1.0)),
    ((0.50, 0.66, 0.48, 1.0), (0.90, 0.92, 0.84, 1.0), (0.32, 0.45, 0.32, 1.0)),
    ((0.92, 0.72, 0.28, 1.0), (0.98, 0.95, 0.88, 1.0), (0.92, 0.72, 0.28, 1.0)),
)


def design(index: int) -> Bowl:
    """The sizes of instance `index`; 0 is a cereal bowl."""
    if index == 0:
        return Bowl()
    rng = specimen_rng("bowl", index)
    diameter = rng.uniform(0.120, 0.170)
    outside, inside, rim = in_turn(index, _GLAZES)
    return Bowl(
        diameter=round(float(diameter), 4),
        height=round(float(np.clip(diameter * rng.uniform(0.36, 0.50), 0.045, 0.075)), 4),
        wall=round(float(rng.uniform(0.0034, 0.005)), 4),
        foot=round(float(diameter * rng.uniform(0.42, 0.50)), 4),
        ring=round(float(rng.uniform(0.005, 0.007)), 4),
        bend=(round(float(rng.uniform(0.58, 0.70)), 3), round(float(rng.uniform(0.19, 0.30)), 3)),
        outside=outside,
        inside=inside,
        rim=rim,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    bowl = design(index)
    outer, inner = _wall_curves(bowl)
    section = _section(bowl, outer, inner)
    lift = bowl.height / 2
    widest = 2 * float(max(part[:, 0].max() for part in section))
    mass = revolved_mass(np.concatenate(section), STONEWARE)
    centre = mass.center_of_mass - [0.0, 0.0, lift]
    body = Body(
        name="bowl",
        collision=_collision(bowl, outer - [0, lift], inner - [0, lift]),
        visual=tuple(
            Shape("mesh", mesh=lathe(part - [0, lift], 96), rgba=rgba)
            for part, rgba in zip(section, (bowl.outside, bowl.rim, bowl.inside), strict=True)
        ),
        mass_properties=MassProperties(mass.mass, centre, mass.inertia),
    )
    label = PoseLabel(
        origin=np.zeros(3),
        # X is the axis, up; nothing fixes Y: it is x of the frame.
        rotation=np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
        object_type="axial",
        extents=np.array([bowl.height, widest, widest]),
        symmetry=SymmetryGroup.about_x(),
    )
    return Specimen(label, (body,))


def _wall_curves(bowl: Bowl) -> tuple[np.ndarray, np.ndarray]:
    """Outer and inner side of the wall from the foot to the rim's plane, point by point opposite.

    The outer side is a parabola (a quadratic Bezier curve), the inner one its parallel.
    """
    start = np.array([bowl.foot / 2, bowl.ring])
    end = np.array([bowl.diameter / 2, bowl.height])
    control = start + (end - start) * bowl.bend
    t = np.linspace(0, 1, CURVE_POINTS)[:, None]
    outer = (1 - t) ** 2 * start + 2 * t * (1 - t) * control + t**2 * end
    slope = (1 - t) * (control - start) + t * (end - control)
    normal = np.stack([-slope[:, 1], slope[:, 0]], 1) / np.linalg.norm(slope, axis=1)[:, None]
    inner = outer + bowl.wall * normal
    # The parallel of the last points rises above the rim's plane: end the inner side there.
    crossing = np.interp(bowl.height, inner[:, 1], np.arange(CURVE_POINTS))
    index = np.linspace(0, crossing, CURVE_POINTS)
    inner = np.stack([np.interp(index, np.arange(CURVE_POINTS), inner[:, k]) for k in (0, 1)], 1)
    return outer, inner


def _section(
    bowl: Bowl, outer: Float[np.ndarray, "n 2"], inner: Float[np.ndarray, "n 2"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outside, rim and inside profile, from the axis under the foot back to the axis."""
    foot, recess = bowl.foot / 2, RECESS
    under = np.array([[0, recess], [foot - 0.0055, recess], [foot - 0.0045, 0], [foot, 0]])
    floor = np.array([[0, inner[0, 1]]])
    corners = np.concatenate([under, outer, inner[::-1], floor])
    last = len(under) + CURVE_POINTS - 1
    lip = 0.4 * bowl.wall
    outline = fillet(corners, {2: 0.0008, 3: 0.001, last: lip, last + 1: lip}, 5)
    start = last + 2 * 5  # two foot arcs come before
    stop = start + 2 * 5 + 2
    return outline[: start + 1], outline[start:stop], outline[stop - 1 :]


def _collision(
    bowl: Bowl, outer: Float[np.ndarray, "n 2"], inner: Float[np.ndarray, "n 2"]
) -> tuple[Shape, ...]:
    """A disc, which fills the recess under the foot as well, and rings of wedges."""
    bottom = -bowl.height / 2
    disc = np.eye(4)
    disc[2, 3] = (bottom + inner[0, 1]) / 2
    shapes = [Shape("cylinder", (bowl.foot / 2, (inner[0, 1] - bottom) / 2), disc)]
    for start, stop in ((0, JOINT), (JOINT, CURVE_POINTS - 1)):
        outside = outer[[start, (start + stop) // 2, stop]]
        chord = inner[[start, stop]]
        # The inner side is hollow this way too: half the chord's sagitta on either side of it.
        along = chord[1] - chord[0]
        into = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        sagitta = ((inner[start:stop] - chord[0]) @ into).max()
        shapes += wall_wedges(outside, chord + into * sagitta / 2, WEDGES)
    return tuple(shapes)
