"""Draw the figures of the documentation from the tables beside this file: python docs/plots/draw.py

Each figure is an SVG whose text and lines take the colours of the reader's light or dark scheme.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from concept_figures import protocol, symmetry
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter
from plot_style import (
    BLUE,
    FAINT,
    GREY,
    INK,
    ORANGE,
    TEAL,
    VIOLET,
    axes_of,
    legend,
    new_figure,
    svg,
)

from manipose_mj.evaluation.statistics import wilson_interval

FOLDER = Path(__file__).parent
CATEGORIES = ("bowl", "cup", "mug", "box", "hammer", "razor")
TYPE_COLOURS = {"axial": TEAL, "mirror": ORANGE, "functional": VIOLET}


def rows(name: str) -> list[dict[str, str]]:
    """The lines of a table beside this file, by the names of its columns."""
    with (FOLDER / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


# What tasks of protocol v1 are alike in, by how their names begin.
FAMILIES = {
    "single object": ("single_object/",),
    "open a drawer": (
        "articulated/open_bottom_drawer",
        "articulated/open_middle_drawer",
        "articulated/open_top_drawer",
    ),
    "open a door": (
        "articulated/open_cabinet_door",
        "articulated/open_microwave",
        "articulated/open_oven",
    ),
    "close": ("articulated/close_",),
    "store": ("articulated/store_",),
    "take out": ("articulated/take_out_",),
    "clutter": ("clutter/",),
}


def protocol_v1() -> Figure:
    """Success of the baseline by family of tasks and by what it is told of objects, with Wilson's interval."""
    table = rows("protocol_v1")
    figure = new_figure(7.2, 4.2)
    axes = axes_of(figure, grid="x")
    bars = (("true", 0.26, TEAL), ("true, other seeds", 0, BLUE), ("estimated", -0.26, ORANGE))
    for poses, shift, colour in bars:
        for y, starts in enumerate(reversed(FAMILIES.values())):
            own = [r for r in table if r["task"].startswith(starts) and r["poses"] == poses]
            if not own:
                continue
            won, of = (sum(int(row[name]) for row in own) for name in ("successes", "episodes"))
            low, high = wilson_interval(won, of)
            axes.barh(y + shift, 100 * won / of, color=colour, height=0.24)
            axes.plot([100 * low, 100 * high], [y + shift] * 2, color=INK, linewidth=1.4)
    axes.set_yticks(range(len(FAMILIES)), list(reversed(FAMILIES)))
    axes.set_xlim(0, 100)
    axes.set_ylim(-0.7, len(FAMILIES) - 0.3)
    axes.set_xlabel("success at end [%], line: Wilson 95 % interval")
    axes.legend(
        handles=[
            Patch(color=TEAL, label="true poses, certified starts"),
            Patch(color=BLUE, label="true poses, other seeds"),
            Patch(color=ORANGE, label="estimated poses"),
        ],
        frameon=False,
        labelcolor=INK,
        ncols=3,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
    )
    return figure


def robustness() -> Figure:
    """Success of the baseline against the size of each error, a line for each task."""
    table = rows("robustness")
    panels = (
        ("pose_error_cm", "pose error [cm]"),
        ("pose_error_deg", "pose error [deg]"),
        ("latency_ms", "latency [ms]"),
        ("camera_error_deg", "calibration error [deg]"),
        ("depth_noise", "depth noise [of a Kinect]"),
        ("cameras", "cameras"),
    )
    tasks = {row["task"]: None for row in table}
    figure = new_figure(7.2, 4.8)
    for place, (error, label) in enumerate(panels, start=1):
        axes = axes_of(figure, 2, 3, place)
        for task, colour, marker in zip(tasks, (TEAL, ORANGE, VIOLET), "os^", strict=False):
            own = [row for row in table if (row["task"], row["error"]) == (task, error)]
            if not own:
                continue
            x, won, of, low, high = np.array(
                [
                    [float(r[c]) for c in ("size", "successes", "episodes", "low", "high")]
                    for r in own
                ]
            ).T
            axes.fill_between(x, 100 * low, 100 * high, color=colour, alpha=0.12, linewidth=0)
            axes.plot(x, 100 * won / of, f"{marker}-", color=colour, label=task)
        axes.set_ylim(-4, 104)
        axes.set_xlabel(label)
        if error == "cameras":
            axes.set_xticks((1, 2, 3))
        if place in (1, 4):
            axes.set_ylabel("success at end [%]")
    handles, names = figure.axes[0].get_legend_handles_labels()
    figure.legend(
        handles,
        names,
        loc="outside lower center",
        ncols=3,
        frameon=False,
        labelcolor=INK,
        fontsize=7,
    )
    return figure


def pose_methods() -> Figure:
    """Mean orientation and origin errors of all methods on unified labels."""
    methods = (
        ("ours", TEAL, "o"),
        ("paper", BLUE, "s"),
        ("CPPF as published", ORANGE, "^"),
        ("multi-start ICP", GREY, "D"),
    )
    figure = new_figure(7.2, 3.5)
    for place, column, label in (
        (1, "rotation_mean_deg", "mean orientation error [deg]"),
        (2, "origin_mean_cm", "mean origin error [cm]"),
    ):
        axes = axes_of(figure, 1, 2, place)
        for shift, (method, colour, marker) in enumerate(methods):
            values = _by_category(method, "unified", column)
            x = np.arange(len(CATEGORIES)) + 0.14 * (shift - 1.5)
            axes.plot(x, values, marker, color=colour, label=method)
        axes.set_yscale("log")
        axes.set_xticks(range(len(CATEGORIES)), CATEGORIES)
        axes.set_ylabel(label)
        axes.yaxis.set_major_formatter("{x:g}")
    handles, names = figure.axes[0].get_legend_handles_labels()
    figure.legend(
        handles, names, loc="outside lower center", ncols=4, frameon=False, labelcolor=INK
    )
    return figure


def original_labels() -> Figure:
    """What original labels cost, for ours and for CPPF."""
    figure = new_figure(7.2, 3.2)
    for place, method in ((1, "ours"), (2, "CPPF as published")):
        axes = axes_of(figure, 1, 2, place)
        x = np.arange(len(CATEGORIES))
        for shift, labels, colour in ((-0.19, "unified", TEAL), (0.19, "original", ORANGE)):
            values = _by_category(method, labels, "rotation_mean_deg")
            axes.bar(x + shift, values, width=0.36, color=colour, label=f"{labels} labels")
        axes.set_xticks(x, CATEGORIES)
        axes.set_ylim(0, 105)
        axes.set_title(method, fontsize=10)
        axes.set_ylabel("mean orientation error [deg]")
    legend(figure.axes[0], loc="upper left")
    return figure


def types() -> Figure:
    """Median orientation error of the networks of whole types, a row for each category."""
    table = sorted(
        rows("types"), key=lambda r: (r["type"], float(r["rotation_median_deg"])), reverse=True
    )
    figure = new_figure(7.2, 9.4)
    axes = axes_of(figure, grid="x")
    for y, row in enumerate(table):
        value, flipped = float(row["rotation_median_deg"]), int(row["flipped_percent"])
        axes.plot([0.15, value], [y, y], color=FAINT, linewidth=1.2)
        axes.plot(value, y, "o", color=TYPE_COLOURS[row["type"]], markersize=6)
        if flipped >= 5:
            axes.text(value * 1.13, y, f"{flipped} % flipped", va="center", color=INK, fontsize=8)
    axes.set_xscale("log")
    axes.set_xlim(0.15, 40)
    axes.set_ylim(-0.8, len(table) - 0.2)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_yticks(range(len(table)), [row["category"] for row in table], fontsize=8)
    axes.set_xlabel("median orientation error [deg]")
    for name, colour in TYPE_COLOURS.items():
        axes.plot([], [], "o", color=colour, label=name)
    legend(axes, loc="upper right")
    return figure


def unseen_categories() -> Figure:
    """Seen and unseen: medians of categories left out of training beside those with training on them."""
    seen = {row["category"]: float(row["rotation_median_deg"]) for row in rows("types")}
    figure = new_figure(5.2, 4.2)
    axes = axes_of(figure, grid="both")
    axes.plot([0.1, 200], [0.1, 200], color=FAINT, linewidth=1.4)
    for row in rows("unseen_categories"):
        x, y = seen[row["category"]], float(row["rotation_median_deg"])
        axes.plot(x, y, "o", color=TYPE_COLOURS[row["type"]])
        beside = row["category"] in {"drinkbox", "remote", "chips can", "pear", "toothbrush"}
        below = row["category"] in {"helmet", "trash bin"}
        axes.annotate(
            row["category"],
            (x, y),
            xytext=(-5 if beside else 5, -9 if below else 3),
            ha="right" if beside else "left",
            textcoords="offset points",
            color=INK,
            fontsize=8,
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(0.12, 9)
    axes.set_ylim(0.12, 260)
    axes.set_xticks([0.2, 0.5, 1, 2, 5])
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("median error with the category in training [deg]")
    axes.set_ylabel("median error without it [deg]")
    for name, colour in TYPE_COLOURS.items():
        axes.plot([], [], "o", color=colour, label=name)
    legend(axes, loc="lower right")
    return figure


def corrupted_clouds() -> Figure:
    """Median orientation error with outliers and with parts of the cloud hidden."""
    figure = new_figure(7.2, 3.0)
    for place, corruption, label in (
        (1, "outliers", "points that are outliers [%]"),
        (2, "occlusion", "points hidden [%]"),
    ):
        axes = axes_of(figure, 1, 2, place)
        for category, colour in (("cup", TEAL), ("box", ORANGE)):
            own = [
                (float(r["percent"]), float(r["rotation_median_deg"]))
                for r in rows("corrupted_clouds")
                if (r["category"], r["corruption"]) == (category, corruption)
            ]
            axes.plot(*np.array(own).T, "o-", color=colour, label=category)
        axes.set_yscale("log")
        axes.set_ylim(0.3, 120)
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_xlabel(label)
        axes.set_ylabel("median orientation error [deg]")
    legend(figure.axes[0], loc="upper left")
    return figure


def furniture() -> Figure:
    """Shares of handles and joints found and right, by the network and once all points are fitted."""
    measures = ("found", "centre", "axes", "joint", "all")
    figure = new_figure(7.2, 3.2)
    axes = axes_of(figure)
    for shift, row in enumerate(each for each in rows("furniture") if each["views"] == "3"):
        colour = TEAL if row["objects"] == "catalogue" else ORANGE
        x = np.arange(len(measures)) + 0.2 * (shift - 1.5)
        axes.bar(
            x,
            [float(row[m]) for m in measures],
            width=0.18,
            color=colour,
            alpha=0.6 if row["by"] == "network" else 1.0,
            label=f"{row['objects']}, {row['by']}",
        )
    axes.set_xticks(range(len(measures)), measures)
    axes.set_ylim(0, 100)
    axes.set_ylabel("share of visible handles [%]")
    axes.legend(
        frameon=False, labelcolor=INK, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0)
    )
    return figure


FIGURES = (
    protocol_v1,
    robustness,
    pose_methods,
    original_labels,
    types,
    unseen_categories,
    corrupted_clouds,
    furniture,
    symmetry,
    protocol,
)


def _by_category(method: str, labels: str, column: str) -> list[float]:
    chosen = {
        row["category"]: float(row[column])
        for row in rows("pose_methods")
        if (row["method"], row["labels"]) == (method, labels)
    }
    return [chosen[category] for category in CATEGORIES]


def main(folder: Path = FOLDER, only: Iterable[str] = ()) -> None:
    """Write the figures into a folder."""
    for figure in FIGURES:
        name = figure.__name__
        if not only or name in only:
            (folder / f"{name}.svg").write_text(svg(figure(), name), encoding="utf-8")


if __name__ == "__main__":
    main()
