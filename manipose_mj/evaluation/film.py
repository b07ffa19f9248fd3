"""Pictures of an episode, drawn again from its trajectory."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from manipose_mj.control.failure import STAGES
from manipose_mj.evaluation.records import EpisodeResult, Trajectory
from manipose_mj.mjcf.film import encode_animation
from manipose_mj.mjcf.pictures import Painter

CAMERA = "overview"
STILLS = 6
PLAYED_FPS = 12.0
PLAYED_S = 6.0
LAST_S = 1.5  # how long an animation shows how the episode ended


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
    film: Film, model: mujoco.MjModel, trajectory: Trajectory, painter: Painter, *, animate: bool
) -> Film:
    """The film with its stills and, if asked for, its animation.

    Args:
      film: What to complete.
      model: The scene of the episode.
      trajectory: Its states.
      painter: Makes a picture of a state.
      animate: Whether to draw the animation too, which takes a dozen times as long.

    Raises:
      ValueError: The trajectory is of another model, or has no state.
    """
    count = len(trajectory.times)
    if trajectory.qpos.shape != (count, model.nq) or not count:
        shape = trajectory.qpos.shape
        raise ValueError(f"{count} states of shape {shape} do not fit a scene of {model.nq}")
    data = mujoco.MjData(model)

    def picture(index: int) -> np.ndarray:
        data.qpos[:] = trajectory.qpos[index]
        mujoco.mj_forward(model, data)
        return painter.paint(data, CAMERA)

    shown = _spread(count, STILLS)
    stills = tuple(
        Still(_address([picture(i)]), f"{trajectory.times[i]:.1f} s {trajectory.annotations[i]}")
        for i in shown
    )
    if not animate:
        return replace(film, stills=stills)
    played = _spread(count, round(PLAYED_FPS * PLAYED_S))
    frames = [picture(i) for i in played]
    duration = float(trajectory.times[-1] - trajectory.times[0])
    return replace(
        film,
        stills=stills,
        animation=_address(frames + frames[-1:] * round(PLAYED_FPS * LAST_S)),
        speed=duration * PLAYED_FPS / len(frames),
    )


def _spread(count: int, wanted: int) -> list[int]:
    """At most `wanted` indices below `count`, evenly spread, with the first and the last."""
    return sorted({math.floor(i + 0.5) for i in np.linspace(0, count - 1, min(count, wanted))})


def _address(frames: list[np.ndarray]) -> str:
    webp = encode_animation(frames, fps=PLAYED_FPS)
    return "data:image/webp;base64," + base64.b64encode(webp).decode("ascii")
