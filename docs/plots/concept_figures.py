"""Figures of concepts, which need no table."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from plot_style import BLUE, BOX, INK, ORANGE, TEAL, VIOLET, axes_of, legend, new_figure

from manipose_mj.poses import SymmetryGroup, compose, pose_error, rotation_about


def symmetry() -> Figure:
    """The rotation error that remains after a turn about X, for each symmetry group."""
    x_axis = np.array([1.0, 0.0, 0.0])
    quarter = SymmetryGroup.generated(rotation_about(x_axis, np.pi / 2)[None])
    groups = (
        ("none (mug)", SymmetryGroup.identity(), ORANGE),
        ("half turn (pot)", SymmetryGroup.two_planes(), VIOLET),
        ("quarter turns (square box)", quarter, BLUE),
        ("axis (bowl)", SymmetryGroup.about_x(), TEAL),
    )
    turns = np.linspace(0, 360, 361)
    figure = new_figure(7.2, 3.0)
    axes = axes_of(figure)
    for name, group, colour in groups:
        poses = [compose(rotation_about(x_axis, np.deg2rad(t)), np.zeros(3)) for t in turns]
        errors = [float(pose_error(pose, np.eye(4), group)[1]) for pose in poses]
        axes.plot(turns, np.rad2deg(errors), color=colour, label=name, linewidth=2)
    axes.set_xticks(range(0, 361, 90))
    axes.set_yticks(range(0, 181, 45))
    axes.set_xlim(0, 360)
    axes.set_xlabel("turn of the object about its X [deg]")
    axes.set_ylabel("rotation error [deg]")
    legend(axes, loc="upper left", fontsize=9)
    return figure


def protocol() -> Figure:
    """From a frozen seed to an episode's verdict."""
    boxes = (
        ("protocol v1", "100 seeds per task\ntest objects"),
        ("episode start", "objects, poses, goals\nfrom one seed"),
        ("policy", "observations in,\nactions out"),
        ("verdict", "success at end, once\nor a failure's stage"),
        ("report", "rate, Wilson interval,\npictures"),
    )
    figure = new_figure(7.2, 1.25)
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.set_xlim(0, 5)
    axes.set_ylim(0, 1)
    for column, (title, text) in enumerate(boxes):
        box = FancyBboxPatch(
            (column + 0.04, 0.1),
            0.8,
            0.8,
            boxstyle="round,pad=0,rounding_size=0.06",
            fc=BOX,
            ec=TEAL,
        )
        axes.add_patch(box)
        axes.text(
            column + 0.44,
            0.72,
            title,
            ha="center",
            va="center",
            color=INK,
            weight="bold",
            fontsize=9,
        )
        axes.text(column + 0.44, 0.38, text, ha="center", va="center", color=INK, fontsize=7)
        if column:
            axes.annotate(
                "",
                (column + 0.03, 0.5),
                (column - 0.15, 0.5),
                arrowprops={"arrowstyle": "->", "color": INK},
            )
    return figure
