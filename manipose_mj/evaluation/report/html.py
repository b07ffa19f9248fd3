"""The report of an evaluation: one HTML file that needs nothing beside it."""

from __future__ import annotations

import json
import logging
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import timedelta
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
import joblib
import mujoco
from markupsafe import Markup

from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.protocol.own_assets import pool_folders
from manipose_mj.evaluation.records import (
    EpisodeResult,
    read_results,
    read_trajectory,
    trajectory_path,
    write_atomically,
)
from manipose_mj.evaluation.report.film import WITH_GL, WITHOUT_GL, Film, choose, shoot
from manipose_mj.evaluation.report.histograms import error_histograms
from manipose_mj.evaluation.results_folder import RESULTS_FILE, SUMMARY_FILE
from manipose_mj.evaluation.statistics import wilson_interval
from manipose_mj.mjcf.cameras import gl
from manipose_mj.tasks.goals import Tolerance

if TYPE_CHECKING:
    from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

REPORT_FILE = "report.html"

logger = logging.getLogger(__name__)

# The model in which an episode took place.
Scene = Callable[["EnvConfig", "EpisodeSpec"], mujoco.MjModel]


def simulated(config: EnvConfig, spec: EpisodeSpec) -> mujoco.MjModel:
    """The scene of every real evaluation."""
    from manipose_mj.evaluation.episode import scene_model

    return scene_model(config, spec)


def write_report(out: Path, *, jobs: int = 1, scene: Scene = simulated) -> Path:
    """Write `report.html` into the folder of a finished evaluation.

    What cannot be drawn is left out with a line that says why.

    Args:
      out: The evaluation's folder.
      jobs: Episodes to draw at the same time.
      scene: Makes the model of an episode; must survive pickling by `cloudpickle`.

    Returns:
      The report's path.

    Raises:
      InputError: The folder holds no finished evaluation.
    """
    results, _ = read_results(out / RESULTS_FILE)
    try:
        summary = json.loads((out / SUMMARY_FILE).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError):
        path = out / SUMMARY_FILE
        raise InputError(f"{path}: missing or unreadable; run the evaluation first") from None
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("manipose_mj.evaluation.report", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["scaled"] = _scaled
    ordered = sorted(results, key=lambda r: r.key)
    tasks = {task: list(group) for task, group in groupby(ordered, key=lambda r: r.task)}
    films = [film for group in tasks.values() for film in choose(group)]
    pool: Any = joblib.Parallel(n_jobs=max(1, min(jobs, len(films))))
    drawn = pool(joblib.delayed(_drawn)(film, out, summary, scene) for film in films)
    html = environment.get_template("template.html").render(
        summary=summary,
        sections=[
            _section(task, group, summary, [f for f in drawn if f.result.task == task])
            for task, group in tasks.items()
        ],
        episodes=len(results),
        wall=timedelta(seconds=round(sum(r.wall_s for r in results))),
        no_gl="" if gl.working_backend() else gl.why_not(),
    )
    path = out / REPORT_FILE
    write_atomically(path, html.encode("utf-8", "replace"))
    return path


def _section(
    task: str, results: list[EpisodeResult], summary: dict[str, Any], films: list[Film]
) -> dict[str, Any]:
    return {
        "task": task,
        "anchor": task.replace("/", "-"),
        "row": summary["tasks"][task],
        "objects": _by_object(results),
        "histograms": [Markup(svg) for svg in error_histograms(results, Tolerance())],
        "films": films,
        "failed": [r for r in results if r.failure is not None],
    }


def _drawn(film: Film, out: Path, summary: dict[str, Any], scene: Scene) -> Film:
    """The film with its pictures, or with the reason why it has none."""
    result = film.result
    path = trajectory_path(out, result.task, result.episode)
    if not path.exists():
        return replace(film, note="no pictures: the episode left no trajectory")
    playback = WITHOUT_GL if gl.working_backend() is None else WITH_GL
    if film.kind != "success":
        playback = None
    try:
        trajectory = read_trajectory(path)
        from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

        objects, split = _objects(result, summary), summary["split"]
        config = EnvConfig(result.task, obs_mode="state", objects=objects, split=split)
        model = scene(config, EpisodeSpec(**_asked(result, summary)))
        return shoot(film, model, trajectory, playback)
    except Exception as error:  # the numbers must not be lost for a picture
        logger.debug("episode %d of %s", result.episode, result.task, exc_info=True)
        return replace(film, note=f"no pictures: {' '.join(str(error).split())}")


def _objects(result: EpisodeResult, summary: dict[str, Any]) -> Sequence[str] | None:
    """What the task's environment drew from instead of built-in objects."""
    if not summary.get("assets"):
        return summary["objects"]
    return pool_folders(summary["protocol"], result.task, summary["assets"])


def _asked(result: EpisodeResult, summary: dict[str, Any]) -> dict[str, Any]:
    """The fields of an episode's `EpisodeSpec`: a protocol asks for objects too."""
    asked: dict[str, Any] = {}
    if summary.get("protocol"):
        asked = protocol.load(summary["protocol"]).episode(result.task, result.episode).asked
    return {**asked, "seed": result.seed}


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
