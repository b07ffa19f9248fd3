"""Objects that the catalogue does not have: the lower part of one with the upper part of another.

What names a frame is kept by both parts: lower ends stay below and upper ends above, grips stay grips and
what they hold stays that. So a network that has learnt from them does not know objects by heart: it has seen
every end with many others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import trimesh
from jaxtyping import Float

from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup

CUT = (0.25, 0.75)  # where upright objects may be cut, as a share of their height
LENGTHS = (0.02, 0.40)  # of the longest edge of what may come of it [m]
MOST_SCALED = 2.5  # factor by which an upper part may be larger or smaller than it was
_TOOL_SCALE = 0.25  # logarithm of the largest factor between the two parts of a tool
_LEAST = 0.002  # of a cut's width [m]


@dataclass(frozen=True)
class Whole:
    """An object that a part is taken of.

    Attributes:
      mesh: In any frame [m].
      label: In the same frame.
    """

    mesh: trimesh.Trimesh
    label: PoseLabel

    def own(self) -> trimesh.Trimesh:
        """The mesh in the label's frame."""
        vertices = (np.asarray(self.mesh.vertices) - self.label.origin) @ self.label.rotation
        return trimesh.Trimesh(vertices, self.mesh.faces, process=False)


def part_swappable(label: PoseLabel) -> bool:
    """Whether an object has a lower and an upper end, or a grip, to be told from the other one."""
    known = label.object_type in ("axial", "mirror", "functional")
    return known and not np.any(label.symmetry.rotations[:, 0, 0] < 0)


def part_swapped(lower: Whole, upper: Whole, rng: np.random.Generator) -> Whole | None:
    """What `lower` is below a plane across X and `upper` is above one, in the frame of the new label.

    Tools are cut where their label has its origin, which stays there. Other objects are cut anywhere in the
    middle, and the upper part made as wide as the lower one at the cut.

    Args:
      lower: Of the same type as `upper`.
      upper: Of its part above the cut.
      rng: Draws the cuts.

    Returns:
      None where the two do not go together: a cut through nothing, or an upper part that would have to be
      much larger or smaller than it is.
    """
    below, above = lower.own(), upper.own()
    tool = lower.label.object_type == "functional"
    seam = _tools_seam(rng) if tool else _seam(lower, upper, below, above, rng)
    if seam is None:
        return None
    top = _beyond(above, seam.upper, 1.0)
    top.vertices = np.asarray(top.vertices) * seam.scale + seam.shift
    parts = [_beyond(below, seam.lower, -1.0), top]
    vertices = np.concatenate([np.asarray(part.vertices) for part in parts])
    faces = np.concatenate([parts[0].faces, parts[1].faces + len(parts[0].vertices)])
    whole = trimesh.Trimesh(vertices, faces, process=False)
    bounds = np.asarray(whole.bounds)
    if not LENGTHS[0] <= np.ptp(bounds, axis=0).max() <= LENGTHS[1]:
        return None
    label = replace(
        lower.label,
        origin=np.zeros(3) if tool else bounds.mean(axis=0),
        rotation=np.eye(3),
        extents=np.ptp(bounds, axis=0),
        symmetry=common(lower.label.symmetry, upper.label.symmetry),
    )
    return Whole(whole, label)


@dataclass(frozen=True)
class _Seam:
    """Where two objects are cut, along X of their labels [m], and what is done to the upper part."""

    lower: float
    upper: float
    scale: Float[np.ndarray, "3"]
    shift: Float[np.ndarray, "3"]


def _tools_seam(rng: np.random.Generator) -> _Seam:
    scale = np.exp(rng.uniform(-_TOOL_SCALE, _TOOL_SCALE))
    return _Seam(0.0, 0.0, np.full(3, scale), np.zeros(3))


def _seam(
    lower: Whole,
    upper: Whole,
    below: trimesh.Trimesh,
    above: trimesh.Trimesh,
    rng: np.random.Generator,
) -> _Seam | None:
    """Cuts in the middle at which the upper outline is laid on the lower one; None where it does not fit."""
    at, at_above = _height(below, rng), _height(above, rng)
    section, section_above = _section(below, at), _section(above, at_above)
    if section is None or section_above is None:
        return None
    (low, wide), (low_above, wide_above) = section, section_above
    across = wide / wide_above
    if lower.label.symmetry.axial and upper.label.symmetry.axial:
        across = np.full(2, across.max())
    if np.any(across > MOST_SCALED) or np.any(across < 1 / MOST_SCALED):
        return None
    scale = np.array([np.sqrt(across[0] * across[1]), *across])
    return _Seam(
        at, at_above, scale, np.array([at - scale[0] * at_above, *(low - across * low_above)])
    )


def common(one: SymmetryGroup, other: SymmetryGroup) -> SymmetryGroup:
    """What leaves two shapes unchanged that share their frame and are not the same upside down."""
    if one.axial and other.axial:
        return SymmetryGroup.about_x()
    if one.axial or other.axial:
        return other if one.axial else one
    shared = [
        turn
        for turn in one.rotations
        if np.any(np.all(np.isclose(other.rotations, turn, atol=1e-6), (1, 2)))
    ]
    return SymmetryGroup(np.stack(shared))


def _height(own: trimesh.Trimesh, rng: np.random.Generator) -> float:
    low, high = np.asarray(own.bounds)[:, 0]
    return float(low + rng.uniform(*CUT) * (high - low))


def _section(
    own: trimesh.Trimesh, height: float
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]] | None:
    """Least coordinates and widths along Y and Z of the outline at a height."""
    lines = trimesh.intersections.mesh_plane(own, [1.0, 0.0, 0.0], [height, 0.0, 0.0])
    if len(lines) == 0:
        return None
    points = np.asarray(lines).reshape(-1, 3)[:, 1:]
    wide = np.ptp(points, axis=0)
    return None if np.any(wide < _LEAST) else (points.min(axis=0), wide)


def _beyond(own: trimesh.Trimesh, height: float, side: float) -> trimesh.Trimesh:
    """The part above a height, or with `side` -1 below it; open at the cut."""
    vertices, faces, _ = trimesh.intersections.slice_faces_plane(
        own.vertices, own.faces, [side, 0.0, 0.0], [height, 0.0, 0.0]
    )
    return trimesh.Trimesh(vertices, faces, process=False)
