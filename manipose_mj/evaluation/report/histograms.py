"""Pose-error histograms as SVG that takes its colours from the page around it."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from manipose_mj.evaluation.records import EpisodeResult
from manipose_mj.tasks.goals import Tolerance

# Stand-ins that no other part of the drawing uses; the page's own colours replace them.
COLOURS = {"#010203": "currentColor", "#040506": "var(--good)", "#070809": "var(--bad)"}
INK, GOOD, BAD = COLOURS
BINS = 20


def error_histograms(results: Sequence[EpisodeResult], tolerance: Tolerance) -> list[str]:
    """SVG elements: final translation error [cm] and rotation error [deg], where episodes have them.

    Args:
      results: Episodes of one task.
      tolerance: Of the task's goal. The axis shows three times as much, and its last bin takes
        everything beyond.
    """
    figures = []
    for name, unit, field, factor, limit in (
        ("translation error", "cm", "translation_error", 100.0, tolerance.translation),
        ("rotation error", "deg", "rotation_error", math.degrees(1.0), tolerance.rotation),
    ):
        values = [
            [
                factor * getattr(r, field)
                for r in results
                if getattr(r, field) is not None and r.success_at_end == success
            ]
            for success in (True, False)
        ]
        if any(values):
            figures.append(_histogram(values, f"{name} at the end [{unit}]", factor * limit))
    return figures


def _histogram(values: list[list[float]], label: str, limit: float) -> str:
    edge = 3 * limit
    bins = np.linspace(0, edge, BINS + 1)
    clipped = [np.minimum(v, edge * (1 - 1e-9)) for v in values]
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": label, "font.size": 10}):
        figure = Figure(figsize=(4.6, 2.3), layout="constrained")
        axes = figure.add_subplot()
        axes.hist(clipped, bins=bins.tolist(), stacked=True, color=[GOOD, BAD], rwidth=0.9)
        axes.axvline(limit, color=INK, linewidth=1, linestyle=(0, (4, 3)))
        axes.set_xlim(0, edge)
        axes.set_xlabel(label, color=INK)
        axes.set_ylabel("episodes", color=INK)
        axes.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=4, min_n_ticks=1))
        ticks = np.linspace(0, edge, 7)
        beyond = any((np.asarray(v) > edge).any() for v in values)
        names = [f"{t:g}" for t in np.round(ticks, 2)]
        axes.set_xticks(ticks, [*names[:-1], f"≥{names[-1]}" if beyond else names[-1]])
        axes.tick_params(colors=INK, length=3)
        for side, spine in axes.spines.items():
            spine.set_visible(side in ("left", "bottom"))
            spine.set_color(INK)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    for colour, replacement in COLOURS.items():
        svg = svg.replace(colour, replacement)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1)
