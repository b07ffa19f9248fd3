"""The report of an evaluation: one HTML file that needs nothing beside it."""

from __future__ import annotations

import json
import logging
import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from datetime import timedelta
from itertools import groupby
from pathlib import Path
from typing import Any

import jinja2
import mujoco
from markupsafe import Markup

from manipose_mj.errors import InputError
from manipose_mj.evaluation.film import Draw, Film, shoot
from manipose_mj.evaluation.histograms import error_histograms
from manipose_mj.evaluation.records import (
    STAGES,
    EpisodeResult,
    read_results,
    read_trajectory,
    trajectory_path,
    write_atomically,
)
from manipose_mj.evaluation.runner import RESULTS_FILE, SUMMARY_FILE
from manipose_mj.evaluation.statistics import wilson_interval

REPORT_FILE = "report.html"
TOLERANCE = (0.02, math.radians(15))
CAMERA, HEIGHT, WIDTH = "overview", 288, 384

logger = logging.getLogger(__name__)

Scene = Callable[..., mujoco.MjModel]


def write_report(
    out: Path, *, scene: Scene | None = None, draw: Draw | None = None, animate_failures: bool | None = None
) -> Path:
    """Write `report.html` into the folder of a finished evaluation.

    Args:
      out: The evaluation's folder.
      scene: `scene(task, seed=, assets=, object_name=)`, the model of an episode; the simulator's by default.
      draw: Makes a picture of a state; by default with the best renderer that works here.
      animate_failures: Whether failures get an animation as successes do; by default where GL makes it cheap.

    Returns:
      The report's path.

    Raises:
      InputError: The folder holds no finished evaluation, or cannot be written.
    """
    results, _ = read_results(out / RESULTS_FILE)
    try:
        summary = json.loads((out / SUMMARY_FILE).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError):
        raise InputError(f"{out / SUMMARY_FILE}: missing or unreadable; run the evaluation first") from None
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("manipose_mj.evaluation", "."),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["scaled"] = _scaled
    html = environment.get_template("report_template.html").render(
        summary=summary,
        versions=summary["versions"],
        sections=[
            _section(out, task, list(episodes), summary, scene, draw, animate_failures)
            for task, episodes in groupby(sorted(results, key=lambda r: r.key), key=lambda r: r.task)
        ],
        stages=STAGES,
        wall=timedelta(seconds=round(sum(r.wall_s for r in results))),
    )
    path = out / REPORT_FILE
    write_atomically(path, html.encode("utf-8"))
    return path


def _section(
    out: Path,
    task: str,
    results: list[EpisodeResult],
    summary: dict[str, Any],
    scene: Scene | None,
    draw: Draw | None,
    animate_failures: bool | None,
) -> dict[str, Any]:
    return {
        "task": task,
        "id": task.replace("/", "-"),
        "row": summary["tasks"][task],
        "results": results,
        "histograms": [Markup(svg) for svg in error_histograms(results, TOLERANCE)],
        "objects": _by_object(results),
        "films": [],
    }


def _by_object(results: Sequence[EpisodeResult]) -> list[dict[str, Any]]:
    groups: dict[str, list[EpisodeResult]] = defaultdict(list)
    for result in results:
        groups[result.object or "unknown"].append(result)
    rows = []
    for name, group in sorted(groups.items()):
        successes = sum(r.success_at_end for r in group)
        rows.append(
            {
                "object": name,
                "episodes": len(group),
                "successes": successes,
                "interval": wilson_interval(successes, len(group)),
            }
        )
    return rows


def _scaled(value: float | None, factor: float, digits: int) -> str:
    return "–" if value is None else f"{factor * value:.{digits}f}"
