"""The cross-sections of a long thing: their widths and centres along its axis, and where they change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import median_filter

from asset_pipeline.labelling.surface_cloud import SurfaceCloud

SLICES = 140
TRIM = 2.0  # percentile of points left out at each side of a slice
# Of the length, added to widths before they are compared as ratios: noise is half a millimetre. A length of its
# own would move the joint of a small tool against that of a large one of the same shape.
FLOOR = 0.01
WINDOW = 0.045  # of the length, on each side of a change
# It has begun when it is this large for each width, or `begun` of the whole step.
DEPARTURE = 0.04
# What is no larger then is a slope, not a step: it began where the slope starts, so many slices before.
GRADUAL, MAX_BACK = 0.16, 2.5

ON_LINE = 0.0004  # a section's centre is on the axis to within [m]


@dataclass(frozen=True)
class Sections:
    """Slices across an axis, from the first end to the last.

    Attributes: place `(s,)` [m] of their middles along the axis; thickness `(s,)` [m] across the
    mirror plane; width `(s,)` [m] in it; centre `(s,)` [m] in it.
    """

    place: Float[np.ndarray, "s"]
    thickness: Float[np.ndarray, "s"]
    width: Float[np.ndarray, "s"]
    centre: Float[np.ndarray, "s"]

    @classmethod
    def across(
        cls,
        cloud: SurfaceCloud,
        point: Float[np.ndarray, "3"],
        axis: Float[np.ndarray, "3"],
        normal: Float[np.ndarray, "3"],
    ) -> Sections:
        """Slice a surface along `axis`; places and centres are measured from `point`."""
        local = (cloud.points - point) @ np.stack([axis, np.cross(normal, axis), normal], axis=1)
        edges = np.linspace(local[:, 0].min(), local[:, 0].max(), SLICES + 1)
        index = np.clip(np.digitize(local[:, 0], edges) - 1, 0, SLICES - 1)
        order = np.argsort(index, kind="stable")
        bounds = np.searchsorted(index[order], np.arange(SLICES + 1))
        rows = np.zeros((SLICES, 3))
        for k in range(SLICES):
            inside = local[order[bounds[k] : bounds[k + 1]]]
            if len(inside) < 3:
                rows[k] = rows[k - 1]
                continue
            low, high = np.percentile(inside[:, 1], (TRIM, 100 - TRIM))
            thick = 2 * np.percentile(np.abs(inside[:, 2]), 100 - 2 * TRIM)
            rows[k] = thick, high - low, (high + low) / 2
        rows = median_filter(rows, size=(3, 1), mode="nearest")
        return cls((edges[1:] + edges[:-1]) / 2, rows[:, 0], rows[:, 1], rows[:, 2])

    def reversed(self) -> Sections:
        """The same from the other end."""
        return Sections(
            -self.place[::-1], self.thickness[::-1], self.width[::-1], -self.centre[::-1]
        )

    @property
    def length(self) -> float:
        """From end to end [m]."""
        return float(self.place[-1] - self.place[0]) * SLICES / (SLICES - 1)


def joint(
    sections: Sections,
    *,
    thickness_only: bool,
    largest: bool,
    step: float,
    begun: float,
    reach: tuple[float, float],
) -> tuple[float, float]:
    """Where, from the first end on, the section leaves that of the grip.

    At every place the mean logarithms of thickness and width on either side are compared. A peak of
    their change above `step` (the first, or the largest) is a step; it begins where the section departs
    from that before it, towards that after it, by `DEPARTURE`, or by `begun` of the step where that is more.
    The place is at the same share of the length in similar tools of any size.

    Args:
      sections: From the grip's end.
      thickness_only: Whether only the smaller of thickness and width counts, the tool lying flat.
      largest: Whether the largest step counts, not the first.
      step: The least change of the logarithms that counts.
      begun: The share of the step at which it has begun.
      reach: Shares of the length between which the joint is sought.

    Returns:
      The place along the axis [m], and the step's size.
    """
    logs = np.log(np.stack([sections.thickness, sections.width]) + FLOOR * sections.length)
    if thickness_only:
        logs = logs[[int(np.percentile(logs, 90, axis=1).argmin())]]
    window = max(3, round(WINDOW * SLICES))
    first, last = (round(share * SLICES) for share in reach)
    first, last = max(first, window), min(last, SLICES - window)
    change = np.zeros(SLICES)
    for k in range(first, last + 1):
        before, after = logs[:, k - window : k], logs[:, k : k + window]
        change[k] = np.abs(after.mean(axis=1) - before.mean(axis=1)).sum()
    start = first + int(change[first : last + 1].argmax())
    if not largest and change[start] > step:
        start = int(np.argmax(change > step))
    size = float(change[start : min(start + window, last) + 1].max())
    level = np.median(logs[:, max(0, start - 2 * window) : start - window + 1], axis=1)
    limit = max(DEPARTURE * len(logs), begun * size)
    after = logs[:, start : start + window].mean(axis=1)
    towards = np.sign(after - logs[:, start - window : start].mean(axis=1))
    departure = (towards[:, None] * (logs - level[:, None])).sum(axis=0)
    departed = departure > limit
    begin, end = start - window, min(start + window, SLICES - 3)
    while begin < end and not departed[begin : begin + 3].all():
        begin += 1
    pitch = float(sections.place[1] - sections.place[0])
    back = 0.5
    slope = (departure[begin + 2] - departure[begin]) / 2
    if departure[begin] < GRADUAL and slope > 0:
        back = min(float(departure[begin] / slope), MAX_BACK)
    return float(sections.place[begin]) - back * pitch, size


def straight_line(
    place: Float[np.ndarray, "s"], centre: Float[np.ndarray, "s"]
) -> tuple[float, float]:
    """Slope and height at place 0 of the line that most of the centres are on.

    Of all lines through two of them, the one with most centres within `ON_LINE`, fitted to those: a clip
    along two fifths of a pen does not bend its axis, as it would with least absolute deviations.
    """
    first, second = np.triu_indices(len(place), k=max(1, len(place) // 4))
    slopes = (centre[second] - centre[first]) / (place[second] - place[first])
    heights = centre[first] - slopes * place[first]
    off = np.abs(centre - slopes[:, None] * place - heights[:, None])
    best = int(np.count_nonzero(off < ON_LINE, axis=1).argmax())
    on = off[best] < 2 * ON_LINE
    slope, height = np.polyfit(place[on], centre[on], 1)
    return float(slope), float(height)
