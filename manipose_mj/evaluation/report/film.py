"""Pictures of an episode, drawn again from its trajectory."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from manipose_mj.evaluation.records import EpisodeResult, Trajectory
from manipose_mj.failures import STAGES
from manipose_mj.mjcf.cameras.pictures import painter
from manipose_mj.mjcf.views.film import encode_animation

CAMERA = "overview"
STILLS = 6
STILL_SIZE = (270, 360)  # height and width in pixels
LAST_S = 1.5  # how long an animation shows how the episode ended
# Pixels of the shadow map's side: more do not show at these sizes, and take 40 % of the time where GL is software.
_SHADOW_MAP = 2048


@dataclass(frozen=True)
class Playback:
    """An animation's look. Attributes: height, width [pixels]; fps: frames a second; seconds: it lasts."""

    height: int
    width: int
    fps: float
    seconds: float = 6.0


WITH_GL = Playback(height=360, width=480, fps=12.0)
# Each picture costs a quarter of a second there.
WITHOUT_GL = Playback(height=180, width=240, fps=5.0)


@dataclass(frozen=True)
class Still:
    """A picture as a `data:` address, and what happens in it."""

    address: str
    caption: str


@dataclass(frozen=True)
class Film:
    """What a report shows of one episode.

    Attributes:
      kind: `"success"` or the failure's stage.
      result: The episode.
      stills: In the order of time; empty where the episode could not be drawn.
      animation: The whole episode as a `data:` address, if it was asked for.
      speed: How many times faster than simulated time the animation plays.
      note: Why something is missing, where it is.
    """

    kind: str
    result: EpisodeResult
    stills: tuple[Still, ...] = ()
    animation: str | None = None
    speed: float = 1.0
    note: str = ""


def choose(results: Sequence[EpisodeResult]) -> list[Film]:
    """Films to be shot: of the first success and of the first episode of each kind of failure."""
    films = []
    for stage in (None, *STAGES):
        first = next((r for r in results if r.failure == stage), None)
        if first is not None:
            films.append(Film(stage or "success", first))
    return films


def shoot(
    film: Film, model: mujoco.MjModel, trajectory: Trajectory, playback: Playback | None
) -> Film:
    """The film with its stills and, if asked for, its animation.

    Args:
      film: What to complete.
      model: The scene of the episode; its shadow map is made smaller.
      trajectory: Its states.
      playback: The animation's look; None leaves it out, which is several times as fast.

    Raises:
      ValueError: The trajectory is of another model, or has no state.
    """
    count = len(trajectory.times)
    if trajectory.qpos.shape != (count, model.nq) or not count:
        shape = trajectory.qpos.shape
        raise ValueError(f"{count} states of shape {shape} do not fit a scene of {model.nq}")
    shown = _spread(count, STILLS)
    stills = tuple(
        Still(_address([picture], 1.0), f"{trajectory.times[i]:.1f} s {trajectory.annotations[i]}")
        for i, picture in zip(shown, _pictures(model, trajectory, shown, *STILL_SIZE), strict=True)
    )
    if playback is None:
        return replace(film, stills=stills)
    played = _spread(count, round(playback.fps * playback.seconds))
    frames = list(_pictures(model, trajectory, played, playback.height, playback.width))
    duration = float(trajectory.times[-1] - trajectory.times[0])
    return replace(
        film,
        stills=stills,
        animation=_address(frames + frames[-1:] * round(playback.fps * LAST_S), playback.fps),
        speed=duration * playback.fps / len(frames),
    )


def _pictures(
    model: mujoco.MjModel, trajectory: Trajectory, indices: list[int], height: int, width: int
) -> Iterator[np.ndarray]:
    data = mujoco.MjData(model)
    quality = model.vis.quality
    quality.shadowsize = min(quality.shadowsize, _SHADOW_MAP)
    with painter(model, height, width) as drawing:
        for index in indices:
            data.qpos[:] = trajectory.qpos[index]
            mujoco.mj_forward(model, data)
            yield drawing.paint(data, CAMERA)


def _spread(count: int, requested: int) -> list[int]:
    """At most `wanted` indices below `count`, evenly spread, with the first and the last."""
    return sorted({math.floor(i + 0.5) for i in np.linspace(0, count - 1, min(count, requested))})


def _address(frames: list[np.ndarray], fps: float) -> str:
    webp = encode_animation(frames, fps=fps)
    return "data:image/webp;base64," + base64.b64encode(webp).decode("ascii")
