"""Pictures of an episode, drawn again from its trajectory."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from jaxtyping import UInt8
from PIL import Image

from manipose_mj.evaluation.records import EpisodeResult, Trajectory

Picture = UInt8[np.ndarray, "h w 3"]
Draw = Callable[[mujoco.MjModel, mujoco.MjData], Picture]

STILLS = 6
PLAYED_FPS = 12.0
PLAYED_S = 6.0


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
      stills: In the order of time; empty where the episode left no trajectory.
      animation: The whole episode as a `data:` address, if it was asked for.
      speed: How many times faster than simulated time the animation plays.
      note: Why there are no pictures, where there are none.
    """

    kind: str
    result: EpisodeResult
    stills: tuple[Still, ...] = ()
    animation: str | None = None
    speed: float = 1.0
    note: str = ""


def shoot(
    film: Film, model: mujoco.MjModel, trajectory: Trajectory, draw: Draw, *, animate: bool
) -> Film:
    """The film with its stills and, if asked for, its animation.

    Args:
      film: What to complete.
      model: The scene of the episode.
      trajectory: Its states.
      draw: Makes a picture of a state.
      animate: Whether to draw the animation too, which takes a dozen times as long.

    Raises:
      ValueError: The trajectory is of another model.
    """
    if trajectory.qpos.ndim != 2 or trajectory.qpos.shape[1] != model.nq:
        raise ValueError(f"the trajectory has shape {trajectory.qpos.shape}, the model {model.nq}")
    data = mujoco.MjData(model)

    def picture(index: int) -> Picture:
        data.qpos[:] = trajectory.qpos[index]
        data.time = trajectory.times[index]
        mujoco.mj_forward(model, data)
        return draw(model, data)

    count = len(trajectory.times)
    stills = tuple(
        Still(_address([picture(i)]), f"{trajectory.times[i]:.1f} s {trajectory.annotations[i]}")
        for i in _spread(count, STILLS)
    )
    if not animate:
        return replace(film, stills=stills)
    indices = _spread(count, round(PLAYED_FPS * PLAYED_S))
    duration = float(trajectory.times[-1] - trajectory.times[0])
    return replace(
        film,
        stills=stills,
        animation=_address([picture(i) for i in indices]),
        speed=max(1.0, duration * PLAYED_FPS / len(indices)),
    )


def _spread(count: int, wanted: int) -> list[int]:
    """At most `wanted` indices below `count`, evenly spread, with the first and the last."""
    return sorted({math.floor(i + 0.5) for i in np.linspace(0, count - 1, min(count, wanted))})


def _address(pictures: list[Picture]) -> str:
    """One picture, or an animation that repeats for ever, as a WebP in a `data:` address."""
    first, *rest = [Image.fromarray(p) for p in pictures]
    buffer = io.BytesIO()
    if rest:
        # The last picture stays for a while: it shows how the episode ended.
        milliseconds = [round(1000 / PLAYED_FPS)] * len(rest) + [1500]
        options = {"save_all": True, "append_images": rest, "duration": milliseconds, "loop": 0}
        first.save(buffer, "WEBP", quality=60, method=3, **options)
    else:
        first.save(buffer, "WEBP", quality=82, method=4)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
