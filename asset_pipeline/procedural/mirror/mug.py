"""A stoneware mug with a C-shaped handle.

Real sizes. The common 11 oz mug is 82 mm wide and 95 mm tall with a wall of about 4 mm; mugs on sale run
from 75 mm to 95 mm and from 80 mm to 110 mm (the YCB mug: 80 mm wide, 82 mm tall, Calli et al. 2015; the
Room Essentials mug of Google Scanned Objects, measured: 81 mm at the foot, 97 mm at the rim, 105 mm
tall, wall 5.3 mm, its handle reaching out by 41 mm).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry.mass import combine, solid_mass_properties
from asset_pipeline.procedural.revolution import (
    convex_part,
    fillet,
    lathe,
    revolved_mass,
    wall_wedges,
)
from asset_pipeline.procedural.solids import loft
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.assets.geometry import Body, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup

STONEWARE = 2300.0  # [kg/m^3]
WEDGES = 18
HANDLE_PARTS = 7
WHITE: Colour = (0.95, 0.94, 0.91, 1.0)


@dataclass(frozen=True)
class Mug:
    """Sizes [m] and colours.

    Attributes: foot and rim, outer diameters at the bottom and the top; height; wall; bottom,
    thickness; corner, radius of the lower outer edge; reach of the handle beyond the wall; grip, its
    share of the height; square, exponent of its superellipse (2 is round); thick and wide, its
    section; glaze, stripe (None for none) and inside colours.
    """

    foot: float = 0.081
    rim: float = 0.082
    height: float = 0.095
    wall: float = 0.004
    bottom: float = 0.0055
    corner: float = 0.005
    reach: float = 0.034
    grip: float = 0.66
    square: float = 2.5
    thick: float = 0.0085
    wide: float = 0.0135
    glaze: Colour = (0.16, 0.36, 0.56, 1.0)
    stripe: Colour | None = None
    inside: Colour = WHITE

    def outer_radius(self, z: float | Float[np.ndarray, "*n"]) -> float | Float[np.ndarray, "*n"]:
        """Radius of the outer wall at height `z` above the bottom."""
        return (self.foot + (self.rim - self.foot) * z / self.height) / 2


_GLAZES: tuple[tuple[Colour, Colour | None, Colour], ...] = (
    ((0.93, 0.92, 0.88, 1.0), (0.16, 0.30, 0.52, 1.0), WHITE),
    ((0.75, 0.20, 0.16, 1.0), None, WHITE),
    ((0.22, 0.45, 0.36, 1.0), None, (0.88, 0.86, 0.76, 1.0)),
    ((0.95, 0.74, 0.22, 1.0), WHITE, WHITE),
    ((0.20, 0.21, 0.24, 1.0), None, (0.26, 0.27, 0.30, 1.0)),
    ((0.86, 0.55, 0.42, 1.0), (0.95, 0.90, 0.82, 1.0), (0.95, 0.90, 0.82, 1.0)),
    ((0.55, 0.74, 0.78, 1.0), None, WHITE),
)


def design(index: int) -> Mug:
    """The sizes of instance `index`; 0 is the common 11 oz mug, every third fits a Panda's hand."""
    if index == 0:
        return Mug()
    rng = specimen_rng("mug", index)
    widest = rng.uniform(0.075, 0.078) if index % 3 == 1 else rng.uniform(0.078, 0.095)
    taper = float(rng.choice((0.0, 0.0, 0.004, 0.010, -0.004)))
    height = rng.uniform(0.080, 0.110)
    glaze, stripe, inside = in_turn(index, _GLAZES)
    return Mug(
        foot=round(float(widest - max(taper, 0.0)), 4),
        rim=round(float(widest + min(taper, 0.0)), 4),
        height=round(float(height), 4),
        wall=uniform(rng, 0.0032, 0.0048),
        bottom=uniform(rng, 0.005, 0.006),
        corner=uniform(rng, 0.003, 0.006),
        reach=uniform(rng, 0.031, 0.038),
        grip=round(float(rng.uniform(0.60, 0.70)), 3),
        square=round(float(rng.uniform(2.1, 3.0)), 2),
        thick=uniform(rng, 0.0075, 0.0095),
        wide=uniform(rng, 0.012, 0.016),
        glaze=glaze,
        stripe=stripe,
        inside=inside,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: handle along +x, frame at the centre of the bounding box."""
    mug = design(index)
    sections = _handle_sections(mug)
    section = _wall_section(mug)
    widest = section[0][:, 0].max()
    low = np.array([-widest, -widest, 0.0])
    high = np.array([sections[..., 0].max(), widest, mug.height])
    centre = (low + high) / 2
    mass = combine(
        [
            revolved_mass(np.concatenate(section), STONEWARE),
            solid_mass_properties(loft(sections[1:-1]), _handle_mass(sections[1:-1])),
        ]
    )
    body = Body(
        name="mug",
        collision=tuple(_moved(s, -centre) for s in _collision(mug, sections)),
        visual=tuple(_moved(s, -centre) for s in _visuals(mug, section, sections)),
        mass_properties=type(mass)(mass.mass, mass.center_of_mass - centre, mass.inertia),
    )
    length, width, height = high - low
    label = PoseLabel(
        origin=np.zeros(3),
        rotation=np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
        object_type="mirror",
        extents=np.array([height, length, width]),
        symmetry=SymmetryGroup.identity(),
    )
    return Specimen(label, (body,))


def _wall_section(mug: Mug) -> tuple[np.ndarray, np.ndarray]:
    """Outer and inner profile: from the axis under the foot to the rim, and back to the axis."""
    foot, rim, wall, height = mug.foot / 2, mug.rim / 2, mug.wall, mug.height
    recess = foot - mug.corner - 0.004
    corners = np.array(
        [[0, 0.0008], [recess, 0.0008], [recess + 0.0008, 0], [foot, 0], [rim, height]]
        + [[rim - wall, height], [foot - wall, mug.bottom], [0, mug.bottom]]
    )
    lip = 0.42 * wall
    outline = fillet(corners, {3: mug.corner, 4: lip, 5: lip, 6: 0.003}, 6)
    split = 3 + 7 + 7  # the rim's outer arc belongs to the outside
    return outline[:split], outline[split:]


def _handle_sections(mug: Mug) -> Float[np.ndarray, "stations 16 3"]:
    """Loops around the handle, from its upper to its lower root; the first and last are in the wall.

    The centre line is half a superellipse standing on the wall, in the xz plane.
    """
    angles = np.linspace(np.pi / 2, -np.pi / 2, 43)
    middle, half = 0.52 * mug.height, 0.5 * mug.grip * mug.height - mug.thick / 2
    z = middle + half * np.sign(np.sin(angles)) * np.abs(np.sin(angles)) ** (2 / mug.square)
    out = (mug.reach - mug.thick / 2) * np.clip(np.cos(angles), 0, None) ** (2 / mug.square)
    line = np.column_stack([mug.outer_radius(z) + out, np.zeros_like(z), z])
    line = _evenly(line, 36)
    tangents = np.gradient(line, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    sideways = np.array([0.0, 1.0, 0.0])
    normals = np.cross(sideways, tangents)
    along = np.linspace(-1, 1, len(line))
    swell = 1 + 0.22 * np.abs(along) ** 8  # the roots are thicker
    turn = np.arange(16) * (2 * np.pi / 16)
    ring = np.stack([np.cos(turn), np.sin(turn)], 1) * [mug.thick / 2, mug.wide / 2]
    loops = line[:, None] + swell[:, None, None] * (
        ring[None, :, :1] * normals[:, None] + ring[None, :, 1:] * sideways
    )
    inwards = np.array([-0.55 * mug.wall, 0.0, 0.0])
    return np.concatenate([loops[:1] + inwards, loops, loops[-1:] + inwards])


def _evenly(line: Float[np.ndarray, "n 3"], count: int) -> Float[np.ndarray, "count 3"]:
    lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0, lengths[-1], count)
    return np.stack([np.interp(at, lengths, line[:, k]) for k in range(3)], 1)


def _handle_mass(sections: np.ndarray) -> float:
    return STONEWARE * float(loft(sections).volume)


def _collision(mug: Mug, sections: np.ndarray) -> list[Shape]:
    outer, _ = _wall_section(mug)
    foot, rim, wall = mug.foot / 2, mug.rim / 2, mug.wall
    disc = np.eye(4)
    disc[2, 3] = mug.bottom / 2
    shapes = [Shape("cylinder", (foot - wall, mug.bottom / 2), disc)]
    arc = fillet(np.array([[0, 0], [foot, 0], [rim, mug.height]]), {1: mug.corner}, 6)[1:-1]
    arc = arc[arc[:, 0] >= foot - wall]
    lip = 0.42 * wall
    outside = np.array([*arc[[0, -1]], *outer[[-6, -1]]])
    inside = np.array(
        [[foot - wall, arc[0, 1]], [rim - wall, mug.height - lip], [rim - wall + lip, mug.height]]
    )
    shapes += wall_wedges(outside, inside, WEDGES)
    ends = np.round(np.linspace(0, len(sections) - 1, HANDLE_PARTS + 1)).astype(int)
    for start, stop in zip(ends[:-1], ends[1:], strict=True):
        stations = sections[[start, (start + stop) // 2, stop], :]
        # Every other point of a loop; the widest and the thickest stay.
        shapes.append(convex_part(stations[:, ::2].reshape(-1, 3)))
    return shapes


def _visuals(mug: Mug, section: tuple[np.ndarray, np.ndarray], sections: np.ndarray) -> list[Shape]:
    outer, inner = section
    low, high = 0.70 * mug.height, 0.86 * mug.height
    if mug.stripe is None:
        bands = [(outer, mug.glaze)]
    else:
        cut = np.array([[mug.outer_radius(z), z] for z in (low, high)])
        below = outer[outer[:, 1] < low]
        above = outer[outer[:, 1] > high]
        bands = [
            (np.concatenate([below, cut[:1]]), mug.glaze),
            (cut, mug.stripe),
            (np.concatenate([cut[1:], above]), mug.glaze),
        ]
    shapes = [Shape("mesh", mesh=lathe(p, 96), rgba=rgba) for p, rgba in bands]
    seam = np.concatenate([outer[-1:], inner])
    shapes.append(Shape("mesh", mesh=lathe(seam, 96), rgba=mug.inside))
    shapes.append(Shape("mesh", mesh=loft(sections), rgba=mug.glaze))
    return shapes


def _moved(shape: Shape, by: Float[np.ndarray, "3"]) -> Shape:
    if shape.mesh is not None:
        mesh = shape.mesh.copy()
        mesh.vertices = mesh.vertices + by
        return Shape(shape.kind, mesh=mesh, rgba=shape.rgba)
    pose = shape.pose.copy()
    pose[:3, 3] += by
    return Shape(shape.kind, shape.size, pose, rgba=shape.rgba)
