"""Shares of success by what was drawn: a document, and a picture with a curve of each and a map of two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from manipose_mj.evaluation.statistics import wilson_interval
from manipose_mj.robustness.replay import Replay
from manipose_mj.robustness.variation import DRAWN, FACTORS, Variation

BINS = 5
MAP = ("shift_cm", "pad_friction")
_LABELS = {
    "friction": "friction of surfaces, factor",
    "pad_friction": "friction of the finger pads, factor",
    "mass": "mass, factor",
    "gains": "servo stiffness, factor",
    "latency_ms": "latency [ms]",
    "shift_cm": "all shifted by [cm]",
    "turn_deg": "all turned about the first object [deg]",
    "object_shift_cm": "first object shifted by [cm]",
    "object_turn_deg": "first object turned [deg]",
}


def document(
    task: str, variation: Variation, found: Sequence[Replay], **more: Any
) -> dict[str, Any]:
    """What was played, and shares of success in all and by bins of each value, JSON."""
    nominal = [each for each in found if not any(_departs(each).values())]
    varied = [each for each in found if any(_departs(each).values())]
    return {
        "task": task,
        **more,
        "variation": asdict(variation),
        "as_planned": _share(nominal),
        "varied": _share(varied),
        "by_value": {name: curve(varied, name) for name in DRAWN},
        "worlds": [asdict(each) for each in found],
    }


def curve(found: Sequence[Replay], name: str) -> list[dict[str, Any]]:
    """Of each bin of a value its edges and the share of success; none where the value was not drawn."""
    edges, index = _bins(found, name)
    return [
        {"from": float(edges[i]), "to": float(edges[i + 1]), **_share(chosen)}
        for i in range(len(edges) - 1)
        if (chosen := [each for each, at in zip(found, index, strict=True) if at == i])
    ]


def draw(document: dict[str, Any], path: Path) -> None:
    """Write the picture (PNG, SVG or PDF, by the path's ending)."""
    figure = Figure(figsize=(11, 9.4), layout="constrained")
    places = figure.subplots(3, 4)
    for axes, name in zip(places.flat, DRAWN, strict=False):
        rows = [row for row in document["by_value"][name] if row["worlds"]]
        if not rows:
            axes.axis("off")
            continue
        middle = [(row["from"] + row["to"]) / 2 for row in rows]
        share = np.array([row["share"] for row in rows])
        spread = np.abs(np.array([row["wilson_95"] for row in rows]).reshape(-1, 2).T - share)
        axes.errorbar(middle, share, yerr=spread, marker="o", capsize=3)
        axes.set_ylim(0, 1.02)
        axes.set_xlabel(_LABELS[name])
        axes.set_ylabel("share of success")
    for axes in places.flat[len(DRAWN) : -2]:
        axes.axis("off")
    _draw_map(figure, places[2, 2], document)
    places[2, 3].axis("off")
    planned, varied = document["as_planned"], document["varied"]
    lines = (
        document["task"],
        f"as planned: {planned['successes']} of {planned['worlds']}",
        f"varied: {varied['successes']} of {varied['worlds']}",
    )
    places[2, 3].text(0, 0.8, "\n".join(lines), va="top")
    figure.savefig(path, dpi=120)


def _draw_map(figure: Figure, axes: Any, document: dict[str, Any]) -> None:
    """Success by two values at once."""
    worlds = [w for w in document["worlds"] if w["valid"]]
    values = np.array([[w["drawn"][name] for name in MAP] for w in worlds]).reshape(-1, 2)
    success = np.array([w["success"] for w in worlds], float)
    if not len(values) or not np.ptp(values, axis=0).all():
        axes.axis("off")
        return
    counts, *edges = np.histogram2d(*values.T, bins=BINS)
    met, *_ = np.histogram2d(*values.T, bins=edges, weights=success)
    with np.errstate(invalid="ignore"):
        share = met / counts
    shown = axes.pcolormesh(*edges, share.T, norm=Normalize(0, 1), cmap="RdYlGn")
    axes.set_xlabel(_LABELS[MAP[0]])
    axes.set_ylabel(_LABELS[MAP[1]])
    figure.colorbar(shown, ax=axes, label="share of success")


def _departs(replay: Replay) -> dict[str, bool]:
    return {name: abs(value - (name in FACTORS)) > 1e-9 for name, value in replay.drawn.items()}


def _bins(found: Sequence[Replay], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Edges, and in which bin each is."""
    values = np.array([each.drawn[name] for each in found])
    if not len(values) or np.ptp(values) < 1e-9:
        return np.zeros(1), np.full(len(values), -1)
    edges = np.linspace(values.min(), values.max(), BINS + 1)
    return edges, np.clip(np.digitize(values, edges) - 1, 0, BINS - 1)


def _share(found: Sequence[Replay]) -> dict[str, Any]:
    """Of worlds whose physics counts."""
    valid = [each for each in found if each.valid]
    met, count = sum(each.success for each in valid), len(valid)
    return {
        "worlds": count,
        "invalid": len(found) - count,
        "successes": met,
        "share": met / count if count else None,
        "wilson_95": list(wilson_interval(met, count)) if count else None,
    }
