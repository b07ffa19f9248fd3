"""Draw failed episodes of evaluations on a protocol: one strip of pictures each.

Of its trajectory, or where a run's folder has none, of the episode played once more: the same seed gives the same
episode. One that cannot be played again as it was is left out, with a line that says why.
"""

from __future__ import annotations

import io
import json
import shlex
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Any

import mujoco
from pictures.run_labels import as_file_name, grasps_of, label_of
from PIL import Image

from manipose_mj.errors import InputError, ServerLostError
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.evaluation.cards.run_record import RunRecord
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.episode import scene_model
from manipose_mj.evaluation.injected_errors import InjectedErrors
from manipose_mj.evaluation.planner_settings import EXCHANGES, PlannerSettings
from manipose_mj.evaluation.records import (
    EpisodeResult,
    Trajectory,
    read_trajectory,
    trajectory_path,
)
from manipose_mj.evaluation.runner import BaselineRunner, run_one
from manipose_mj.mjcf.cameras.pictures import painter
from manipose_mj.mjcf.views.film import film_strip

PICTURES, HEIGHT, WIDTH = 5, 150, 200
CAMERA = "overview"
Run = tuple[Path, RunRecord]  # its folder and what is in it


def strip_name(result: EpisodeResult, label: str) -> str:
    """The file of an episode's strip; `label` is that of its run."""
    return f"{result.task.replace('/', '__')}-{result.episode}-{as_file_name(label)}.webp"


def draw_strips(runs: Sequence[Run], folder: Path) -> None:
    """Draw every failure that the folder lacks; drop strips of these runs' episodes that did not fail."""
    folder.mkdir(parents=True, exist_ok=True)
    failed: dict[Path, tuple[Path, RunRecord, EpisodeResult]] = {}
    solved: set[Path] = set()
    for kept, record in runs:
        for result in record.results:
            path = folder / strip_name(result, label_of(record.run))
            if result.failure is None:
                solved.add(path)
            else:
                failed[path] = (kept, record, result)
    for path in solved - failed.keys():
        path.unlink(missing_ok=True)
    for path, (kept, record, result) in failed.items():
        if path.exists():
            continue
        try:
            path.write_bytes(_strip(kept, record.run, result))
            sys.stderr.write(f"{path}\n")
        except (InputError, ServerLostError) as error:
            sys.stderr.write(f"no strip of {result.task}, episode {result.episode}: {error}\n")


def _strip(kept: Path, run: Mapping[str, Any], result: EpisodeResult) -> bytes:
    """Pictures from the start of an episode to its end, as a WebP.

    Raises:
      InputError: It has no trajectory, and cannot be played once more as it was.
      ServerLostError: The estimator's server went away.
    """
    with tempfile.TemporaryDirectory() as scratch:
        config = EvaluationConfig(
            tuple(run["tasks"]),
            Path(scratch),
            episodes=run["episodes"],
            protocol=run["protocol"],
            resample=run.get("resample"),
            assets=_assets(run),
        )
        if config.assets_digest != run["assets sha256"]:
            raise InputError("the assets of its run are not there any more")
        model = _scene(config, result)
        trajectory = _kept_trajectory(kept, result, model)
        if trajectory is None:
            trajectory = _played_once_more(_as_played(config, kept, run), result)
            model = _scene(config, result)
    return _drawn(model, trajectory)


def _assets(run: Mapping[str, Any]) -> tuple[str, ...]:
    """The folders of own assets that a run's command names."""
    words = shlex.split(run["command"])
    after = words[words.index("--assets") + 1 :] if "--assets" in words else []
    return tuple(takewhile(lambda word: not word.startswith("--"), after))


def _scene(config: EvaluationConfig, result: EpisodeResult) -> mujoco.MjModel:
    settings = replace(config.env_config(result.task), obs_mode="state")
    return scene_model(settings, config.episode_spec(result.task, result.episode))


def _kept_trajectory(kept: Path, result: EpisodeResult, model: mujoco.MjModel) -> Trajectory | None:
    """What the run left of the episode, if that fits the scene."""
    try:
        trajectory = read_trajectory(trajectory_path(kept, result.task, result.episode))
    except InputError:
        return None
    return trajectory if trajectory.qpos.shape[1:] == (model.nq,) else None


def _as_played(config: EvaluationConfig, kept: Path, run: Mapping[str, Any]) -> EvaluationConfig:
    """The evaluation with the run's own method; a language model's answers are those on record.

    Raises:
      InputError: It cannot be had.
    """
    if run["policy"] is not None:
        raise InputError("its policy left no trajectory")
    planner, estimator = run["planner"], run["estimator"]
    plans = PlannerSettings()
    if planner["kind"] != "rules":
        if not (kept / EXCHANGES).is_dir():
            raise InputError(f"it left no trajectory, and {kept / EXCHANGES} is not there")
        plans = PlannerSettings(
            "replay", replay=kept / EXCHANGES, instruction=planner.get("instruction")
        )
    asked = estimator and EstimatorSettings(
        estimator["name"],
        json.dumps(estimator["arguments"]) if estimator.get("arguments") else None,
        bool(estimator.get("given CAD")),
    )
    errors = dict(run.get("injected errors") or {})
    if "cameras" in errors:
        errors["cameras"] = tuple(errors["cameras"])
    return replace(
        config,
        pose=run["pose"],
        planner=plans,
        estimator=asked,
        errors=InjectedErrors(**errors),
        grasps=grasps_of(run),
    )


def _played_once_more(config: EvaluationConfig, result: EpisodeResult) -> Trajectory:
    """The trajectory of an episode that is played again.

    Raises:
      InputError: It ends otherwise than it did.
    """
    runner = BaselineRunner(config.planner, config.estimator, config.errors, config.grasps)
    again = run_one(config, runner, result.task, result.episode)
    if (again.failure, again.reason) != (result.failure, result.reason):
        ended = f"{again.failure}, {again.reason}" if again.failure else "success"
        raise InputError(
            f"it ended by {result.failure}, {result.reason}; played once more: {ended}"
        )
    return read_trajectory(trajectory_path(config.out, result.task, result.episode))


def _drawn(model: mujoco.MjModel, trajectory: Trajectory) -> bytes:
    count = len(trajectory.times)
    shown = sorted({round(i * (count - 1) / (PICTURES - 1)) for i in range(PICTURES)})
    data, pictures = mujoco.MjData(model), []
    with painter(model, HEIGHT, WIDTH) as drawing:
        for index in shown:
            data.qpos[:] = trajectory.qpos[index]
            mujoco.mj_forward(model, data)
            pictures.append(drawing.paint(data, CAMERA))
    captions = [f"{trajectory.times[i]:.1f} s {trajectory.annotations[i]}" for i in shown]
    strip = Image.open(io.BytesIO(film_strip(pictures, captions)))
    stream = io.BytesIO()
    strip.save(stream, "WEBP", quality=80)
    return stream.getvalue()
