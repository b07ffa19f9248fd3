"""The figures' colours, which follow the reader's scheme, and empty axes in them."""

from __future__ import annotations

import io

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Stand-ins that no other part of a drawing uses, and what the style below replaces them by.
INK, FAINT, BOX = "#010203", "#040506", "#070809"
VARIABLES = {INK: "var(--ink)", FAINT: "var(--faint)", BOX: "var(--box)"}
STYLE = (
    "<style>:root{--ink:#1d2125;--faint:#d5d9dd;--box:#eef4f3}"
    "@media(prefers-color-scheme:dark){:root{--ink:#e6e8ea;--faint:#434a52;--box:#24313a}}</style>"
)
TEAL, ORANGE, VIOLET, GREY, BLUE = "#13907f", "#d9722e", "#8b6fd1", "#8a8f98", "#3d86c6"


def svg(figure: Figure, name: str) -> str:
    """The figure as SVG with real text; the same figure gives the same bytes."""
    stream = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(stream, format="svg", transparent=True, metadata={"Date": None})
    text = stream.getvalue()
    for colour, variable in VARIABLES.items():
        text = text.replace(colour, variable)
    text = text.replace("'DejaVu Sans'", "system-ui, 'DejaVu Sans'")
    start = text.index("<svg")
    end = text.index(">", start) + 1
    return text[start:end] + STYLE + text[end:]


def axes_of(figure: Figure, *place: int, grid: str = "y") -> Axes:
    """Empty axes in the colours of the page."""
    axes = figure.add_subplot(*place)
    axes.tick_params(colors=INK, length=3)
    axes.tick_params(which="minor", length=0, labelcolor=INK)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(INK)
    axes.grid(axis=grid, color=FAINT, linewidth=0.8)  # pyright: ignore[reportArgumentType]
    axes.set_axisbelow(True)
    for text in (axes.title, axes.xaxis.label, axes.yaxis.label):
        text.set_color(INK)
    return axes


def new_figure(width: float, height: float) -> Figure:
    """A figure of so many inches."""
    return Figure(figsize=(width, height), layout="constrained")


def legend(axes: Axes, **options: object) -> None:
    """The legend without a frame, in the page's ink."""
    axes.legend(frameon=False, labelcolor=INK, **options)  # pyright: ignore[reportArgumentType]
