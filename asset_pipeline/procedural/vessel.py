"""Open vessels of revolution about z: a floor, a wall that stays hollow, a rounded lip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.revolution import fillet, lathe, revolved_mass, wall_wedges
from asset_pipeline.procedural.specimen import Colour
from asset_pipeline.procedural.turned import banded
from manipose_mj.assets.geometry import Shape

CURVE_POINTS = 24
ARC = 5  # segments of a rounding
WEDGE_ERROR = 0.0012  # of a ring's inside, half of its wedges' sagitta [m]
MIN_WEDGES, MAX_WEDGES = 8, 16
MANY = 6  # points of a side, which then is a curve and not a polygon


@dataclass(frozen=True)
class Wall:
    """The wall's section `(r, z)` [m] from the floor to the rim's plane.

    Attributes:
      outer: `(n, 2)`, upwards.
      inner: `(n, 2)`, upwards; its first point is level with the floor. Points of one index face
        each other.
    """

    outer: Float[np.ndarray, "n 2"]
    inner: Float[np.ndarray, "m 2"]


@dataclass(frozen=True)
class Glaze:
    """Colours of a vessel: outside by bands (upper end [m] and colour, as in `turned`), rim, inside."""

    outside: tuple[tuple[float, Colour], ...]
    rim: Colour
    inside: Colour

    @classmethod
    def plain(
        cls, outside: Colour, rim: Colour | None = None, inside: Colour | None = None
    ) -> Glaze:
        """One colour outside; rim and inside are alike unless given."""
        return cls(((np.inf, outside),), rim or outside, inside or outside)


def bent_wall(
    start: Float[np.ndarray, "2"],
    control: Float[np.ndarray, "2"],
    end: Float[np.ndarray, "2"],
    thickness: float,
    points: int = CURVE_POINTS,
) -> Wall:
    """A wall whose outer side is a parabola, a quadratic Bezier curve, and its inner one parallel.

    Args:
      start: Where the outer side leaves the foot `(r, z)` [m].
      control: The Bezier curve's middle point.
      end: The outer side at the rim's plane.
      thickness: [m].
      points: Of each side.
    """
    t = np.linspace(0, 1, points)[:, None]
    outer = (1 - t) ** 2 * start + 2 * t * (1 - t) * control + t**2 * end
    slope = (1 - t) * (control - start) + t * (end - control)
    normal = np.stack([-slope[:, 1], slope[:, 0]], 1) / np.linalg.norm(slope, axis=1)[:, None]
    inner = outer + thickness * normal
    # The parallel of the last points rises above the rim's plane: end the inner side there.
    crossing = np.interp(end[1], inner[:, 1], np.arange(points))
    index = np.linspace(0, crossing, points)
    return Wall(
        outer, np.stack([np.interp(index, np.arange(points), inner[:, k]) for k in (0, 1)], 1)
    )


def upright_wall(outer: Float[np.ndarray, "n 2"], inner: Float[np.ndarray, "m 2"]) -> Wall:
    """A wall whose inner side is a curve of its own, from the floor up to the rim's plane.

    Points are paired by height; neither side runs downwards.
    """
    height = np.clip(outer[:, 1], inner[0, 1], inner[-1, 1])
    return Wall(outer, np.stack([np.interp(height, inner[:, 1], inner[:, 0]), height], 1))


def joints(wall: Wall, count: int) -> tuple[int, ...]:
    """Where to end each of `count` rings, so that the least straight one is as straight as can be."""
    points = len(wall.outer)

    def bend(start: int, stop: int) -> float:
        sides = (wall.outer[start : stop + 1], wall.inner[start : stop + 1][::-1])
        return max(_misfit(side) for side in sides)

    # The least bend of the best partition of the first `stop` points, and where its last ring begins.
    best = [(0.0 if stop == 0 else np.inf, (0,)) for stop in range(points)]
    for _ in range(count):
        best = [
            min((max(best[k][0], bend(k, stop)), (*best[k][1], stop)) for k in range(stop))
            if stop
            else (np.inf, (0,))
            for stop in range(points)
        ]
    return best[-1][1][1:]


def rings(wall: Wall, stops: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Rings of wedges that end at these points of the wall, with as few wedges as are close enough."""
    counted, start = [], 0
    for stop in stops:
        radius = float(wall.inner[start : stop + 1, 0].max())
        half_pitch = np.arccos(1 - 2 * WEDGE_ERROR / radius)
        even = 2 * int(np.ceil(np.pi / half_pitch / 2))
        counted.append((stop, int(np.clip(even, MIN_WEDGES, MAX_WEDGES))))
        start = stop
    return tuple(counted)


def vessel(
    foot: Float[np.ndarray, "f 2"],
    wall: Wall,
    *,
    base: Sequence[Shape],
    rings: Sequence[tuple[int, int]],
    glaze: Glaze,
    density: float,
    lip: float | tuple[float, float],
    rounding: Mapping[int, float] | None = None,
    sections: int = 72,
) -> Piece:
    """An open vessel of one material.

    Args:
      foot: Underside `(r, z)` [m], from the axis to where the wall's outer side begins.
      wall: The wall; between its inner side's first point and the axis the floor is flat.
      base: Convex parts under the floor.
      rings: Of wedges, upwards: the index of the wall's point where each ends, and its wedges.
      glaze: Colours.
      density: [kg/m^3].
      lip: Radii of the rim's outer and inner rounding [m].
      rounding: Radii [m] of corners by index: the foot's, then the outer side's.
      sections: Facets of what is seen.
    """
    outside, rim, inside = _section(foot, wall, lip, dict(rounding or {}))
    visual = (
        *banded(outside, glaze.outside, sections),
        Shape("mesh", mesh=lathe(rim, sections), rgba=glaze.rim),
        Shape("mesh", mesh=lathe(inside, sections), rgba=glaze.inside),
    )
    mass = revolved_mass(np.concatenate([outside, rim, inside]), density)
    return Piece(visual, (*base, *wall_rings(wall, rings)), mass)


def wall_rings(wall: Wall, rings: Sequence[tuple[int, int]]) -> tuple[Shape, ...]:
    """The wall as rings of convex wedges; `rings` as in `vessel`."""
    shapes: list[Shape] = []
    start = 0
    for stop, wedges in rings:
        outer = _straightened(wall.outer[start : stop + 1])
        inner = _straightened(wall.inner[start : stop + 1][::-1])
        shapes += wall_wedges(outer, inner, wedges)
        start = stop
    return tuple(shapes)


def disc(radius: float, low: float, high: float) -> Shape:
    """An upright cylinder between two heights [m]."""
    pose = np.eye(4)
    pose[2, 3] = (low + high) / 2
    return Shape("cylinder", (radius, (high - low) / 2), pose)


def _section(
    foot: np.ndarray, wall: Wall, lip: float | tuple[float, float], rounding: dict[int, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outside, rim and inside profile, from the axis under the foot back to the axis."""
    outer_lip, inner_lip = lip if isinstance(lip, tuple) else (lip, lip)
    inner = wall.inner[np.append(True, np.any(np.diff(wall.inner, axis=0), axis=1))]
    floor = [[0.0, inner[0, 1]]] if inner[0, 0] > 0 else np.empty((0, 2))
    corners = np.concatenate([foot, wall.outer, inner[::-1], floor])
    last = len(foot) + len(wall.outer) - 1
    outline = fillet(corners, {**rounding, last: outer_lip, last + 1: inner_lip}, ARC)
    start = last + ARC * sum(radius > 0 for radius in rounding.values())
    stop = start + 2 * ARC + 2
    return outline[: start + 1], outline[start:stop], outline[stop - 1 :]


def _straightened(side: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
    """A side whose material is on its left, as a convex part can follow it.

    Where it bulges out of the material its ends and middle stay; where it is hollow, it becomes
    the chord, moved into the material by half the sagitta: the same error in the middle and at the ends.
    """
    bulge, chord = _bulge(side), side[[0, -1]]
    if bulge.max() > -bulge.min():
        return side if len(side) < MANY else side[[0, (len(side) - 1) // 2, -1]]
    return chord + _outwards(side) * bulge.min() / 2


def _bulge(side: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n"]:
    """How far its points lie beyond the chord, out of the material [m]."""
    return (side - side[0]) @ _outwards(side)


def _misfit(side: Float[np.ndarray, "n 2"]) -> float:
    """How far the side is from what `_straightened` makes of it [m]."""
    out = _outwards(side)
    frame = np.stack([[-out[1], out[0]], out], axis=1)
    points, kept = (side - side[0]) @ frame, (_straightened(side) - side[0]) @ frame
    if kept[:, 1].max() > 0:
        kept = np.maximum(kept, 0)  # a hull has no hollows
    return float(np.abs(points[:, 1] - np.interp(points[:, 0], kept[:, 0], kept[:, 1])).max())


def _outwards(side: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "2"]:
    along = side[-1] - side[0]
    length = np.linalg.norm(along)
    return np.array([along[1], -along[0]]) / max(length, 1e-12)
