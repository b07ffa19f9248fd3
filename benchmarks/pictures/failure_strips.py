"""Draw failed episodes of evaluations on a protocol: one strip of pictures each.

An episode that left no trajectory is played once more: the same seed gives the same episode.
"""

from __future__ import annotations

import io
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
from PIL import Image

from manipose_mj.control.perception.source_names import GraspSource
from manipose_mj.evaluation.cards.run_record import RunRecord
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.episode import scene_model
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
POSES = ("true", "true, other seeds", "estimated")


def grasps_of(run: Mapping[str, Any]) -> GraspSource:
    """Where a run's grasps came from; older runs do not say so."""
    return run.get("grasps") or ("annotated" if run.get("pose") == "oracle" else "shape")


def poses_of(run: Mapping[str, Any]) -> str:
    """What a run was told of objects, and of which starts, one of `POSES`."""
    if run.get("pose") != "oracle":
        return "estimated"
    return "true" if run.get("resample") is None else "true, other seeds"


def strip_name(result: EpisodeResult, poses: str) -> str:
    """The file of an episode's strip."""
    return f"{result.task.replace('/', '__')}-{result.episode}-{poses.replace(', ', '-').replace(' ', '-')}.webp"


def draw_strips(records: Sequence[RunRecord], folder: Path) -> None:
    """Draw every failure that the folder lacks; drop what is no failure any more."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = set()
    for record in records:
        poses = poses_of(record.run)
        for result in record.results:
            if result.failure is None:
                continue
            path = folder / strip_name(result, poses)
            wanted.add(path)
            if not path.exists():
                path.write_bytes(_strip(record, result))
                sys.stderr.write(f"{path}\n")
    for path in folder.glob("*.webp"):
        if path not in wanted:
            path.unlink()


def _strip(record: RunRecord, result: EpisodeResult) -> bytes:
    """Pictures from the start of an episode to its end, as a WebP.

    Raises:
      RuntimeError: Played once more, it ends otherwise.
    """
    run = record.run
    with tempfile.TemporaryDirectory() as scratch:
        config = EvaluationConfig(
            (result.task,),
            Path(scratch),
            episodes=result.episode + 1,
            pose=run["pose"],
            protocol=run["protocol"],
            resample=run["resample"],
            grasps=grasps_of(run),
        )
        runner = BaselineRunner(config.planner, grasps=config.grasps)
        again = run_one(config, runner, result.task, result.episode)
        if (again.failure, again.reason) != (result.failure, result.reason):
            raise RuntimeError(
                f"{result.task}, episode {result.episode}: {result.failure}, {result.reason}; "
                f"played once more: {again.failure}, {again.reason}"
            )
        trajectory = read_trajectory(trajectory_path(config.out, result.task, result.episode))
        model = scene_model(
            replace(config.env_config(result.task), obs_mode="state"),
            config.episode_spec(result.task, result.episode),
        )
    return _drawn(model, trajectory)


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
