"""A training's curve as a picture."""

from __future__ import annotations

import json
from pathlib import Path

_ERRORS = ("deg_mean", "deg_median", "oracle_deg", "cm_mean", "cm_median")


def draw_curve(curve: Path, picture: Path) -> None:
    """Draw the losses and the errors on held-out views over the steps.

    Args:
      curve: JSON as a training writes it: a list of rows with `step` and figures.
      picture: PNG to write.
    """
    from matplotlib.figure import Figure

    rows = json.loads(curve.read_text())
    names = sorted({name for row in rows for name in row} - {"step", "seconds"})
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    losses, errors = figure.subplots(1, 2)
    held_out = {name for row in rows if "deg_mean" in row for name in row} - set(rows[0])
    for name in names:
        shown = [(row["step"], row[name]) for row in rows if name in row]
        if name in _ERRORS:
            errors.plot(*zip(*shown, strict=True), ".-", label=name.replace("_", " "))
        elif name not in held_out:
            losses.plot(*zip(*shown, strict=True), label=name.replace("_", " "), lw=0.8)
    errors.set_yscale("log")
    for axes, title in ((losses, "losses"), (errors, "errors on held-out views")):
        axes.set_title(title)
        axes.set_xlabel("step")
        axes.grid(alpha=0.3)
        if axes.has_data():
            axes.legend(fontsize="x-small")
    figure.savefig(picture, dpi=120)
