"""The label of a tool: its mirror plane, the straight axis of its grip, and where the grip ends."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from asset_pipeline.labelling.sections import Sections, joint, straight_line
from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.surface_symmetry import (
    STRICT,
    holds,
    mirror,
    residual,
    turns_about_x,
)
from asset_pipeline.labelling.symmetry_fit import (
    around,
    half_turn_axis,
    mirror_planes,
    refined_plane,
)
from asset_pipeline.labelling.tool_axes import functional_rotation
from asset_pipeline.labelling.tool_hints import HINTS, UNKNOWN, ToolHint
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.label_quality import LabelQuality, clear, fits
from manipose_mj.poses import SymmetryGroup, rotation_about

STARTS = 10  # normals around the longest and the thinnest direction from which planes are sought
REFINED = 4  # of which as many are fitted finely
SQUARE = np.deg2rad(4.0)
ROUNDS = 4  # of slicing and fitting the axis
GRIP_END = 0.06  # of the length: rounded ends say nothing about the axis
MARGIN = 0.02  # kept from the joint
JOINT_REACH = (0.28, 0.95)  # shares of the length between which the grip ends
OUTER = 0.35  # of the length, whose sections are compared between the ends
CLEAR_RATIO = 0.15  # by which they differ (logarithm)
NEAR = np.deg2rad(4.0)  # a half-turn axis this near the grip's is the grip's


def tool_label(
    cloud: SurfaceCloud,
    *,
    category: str,
    functional: Float[np.ndarray, "3"] | None,
) -> tuple[PoseLabel, LabelQuality]:
    """The frame of a tool of any attitude.

    - The mirror plane is the best that registration finds around the longest direction. Where two
      hold, square to each other, X is where they meet; else it is about the surface's longest direction
      in the plane.
    - Which end works: `functional` says it, or the category's hint, or (unknown categories) the end
      with the smaller sections.
    - X is then fitted to the centres of the grip's sections; the origin is on it, where the section
      leaves that of the grip (`sections.joint`); the two take turns.
    - A half-turn axis of the whole shape that is nearly X is X.
    - Y and Z follow from `functional_rotation`.

    Args:
      cloud: The surface.
      category: The key of the hint.
      functional: `(3,)`, roughly from grip to functional end, or None.
    """
    hint = HINTS.get(category, UNKNOWN)
    normal, offset, axis = _plane_and_axis(cloud, functional)
    point = cloud.points.mean(axis=0)
    point = point - (normal @ point - offset) * normal
    plane = residual(cloud, mirror(normal), normal * offset)
    axis, ratio = _towards_work(cloud, point, axis, normal, hint, functional)
    place, change = 0.0, 0.0
    for _ in range(ROUNDS):
        sections = Sections.across(cloud, point, axis, normal)
        place, change = joint(
            sections,
            thickness_only=hint.leaves == "thickness",
            largest=hint.joint == "largest",
            step=hint.step,
            begun=hint.begun,
            reach=JOINT_REACH,
        )
        slope, height = straight_line(*_straight_part(sections, place, hint))
        across = np.cross(normal, axis)
        point = point + height * across
        axis = axis + slope * across
        axis = axis / np.linalg.norm(axis)
    turned, through = half_turn_axis(cloud, axis, point + place * axis)
    turned = turned if turned @ axis > 0 else -turned
    residuals = {"plane": plane}
    half_turn = rotation_about(turned, np.pi)
    symmetry = SymmetryGroup.identity()
    if turned @ axis > np.cos(NEAR) and holds(cloud, half_turn, through, STRICT):
        origin = through + ((point + place * axis - through) @ turned) * turned
        axis, point = turned, origin
        normal = normal - (normal @ axis) * axis
        normal = normal / np.linalg.norm(normal)
        place = 0.0
        residuals["half_turn"] = residual(cloud, half_turn, through)
    origin = point + place * axis
    rotation = functional_rotation(cloud.points, origin, axis, normal)
    if "half_turn" in residuals:
        symmetry = turns_about_x(cloud, rotation, origin)
    extents = np.ptp(cloud.points @ rotation, axis=0)
    label = PoseLabel(origin, rotation, "functional", extents, symmetry)
    evidence = [
        fits(plane, STRICT.limit(cloud)),
        clear(ratio, CLEAR_RATIO),
        clear(change, hint.step),
    ]
    return label, LabelQuality(min(evidence), residuals)


def _plane_and_axis(
    cloud: SurfaceCloud, functional: np.ndarray | None
) -> tuple[np.ndarray, float, np.ndarray]:
    """Normal and offset of the mirror plane, and about X, of either sign."""
    spread, directions = np.linalg.eigh(np.cov((cloud.points).T))
    longest = directions[:, int(spread.argmax())]
    thinnest = directions[:, int(spread.argmin())]
    starts = around(longest, STARTS, thinnest) + around(thinnest, STARTS, longest)
    found = [refined_plane(cloud, *p) for p in mirror_planes(cloud, starts)[:REFINED]]
    found.sort(key=lambda p: residual(cloud, mirror(p[0]), p[0] * p[1]))
    held = [p for p in found if holds(cloud, mirror(p[0]), p[0] * p[1], STRICT)]
    for i, a in enumerate(held):
        for b in held[i + 1 :]:
            if abs(a[0] @ b[0]) < np.sin(SQUARE):
                axis = np.cross(a[0], b[0])
                return *a, axis / np.linalg.norm(axis)
    normal, offset = found[0]
    in_plane = cloud.points - np.outer(cloud.points @ normal - offset, normal)
    spread, directions = np.linalg.eigh(np.cov(in_plane.T))
    axis = directions[:, 2]
    if functional is not None and abs(functional @ axis) < abs(functional @ directions[:, 1]):
        axis = directions[:, 1]
    return normal, offset, axis


def _towards_work(
    cloud: SurfaceCloud,
    point: np.ndarray,
    axis: np.ndarray,
    normal: np.ndarray,
    hint: ToolHint,
    functional: np.ndarray | None,
) -> tuple[np.ndarray, float]:
    """The axis towards the functional end, and the logarithm of how much the ends differ."""
    if functional is not None:
        return axis * np.sign(axis @ functional), CLEAR_RATIO
    sections = Sections.across(cloud, point, axis, normal)
    count = round(OUTER * len(sections.place))
    if hint.works == "wide":
        size = np.maximum(sections.thickness, sections.width)
        first, last = np.percentile(size[:count], 90), np.percentile(size[-count:], 90)
    else:
        area = sections.thickness * sections.width
        last, first = area[:count].mean(), area[-count:].mean()
    return (axis if last >= first else -axis), float(abs(np.log(last / first)))


def _straight_part(
    sections: Sections, place: float, hint: ToolHint
) -> tuple[Float[np.ndarray, "s"], Float[np.ndarray, "s"]]:
    """Places and centres of the sections that the axis goes through."""
    length = sections.length
    if hint.straight == "grip":
        chosen = sections.place > sections.place[0] + GRIP_END * length
        chosen &= sections.place < place - MARGIN * length
    else:
        chosen = sections.place > place + MARGIN * length
        chosen &= sections.place < sections.place[-1] - GRIP_END * length
    return sections.place[chosen], sections.centre[chosen]
