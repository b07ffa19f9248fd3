"""`manipose render`: a picture of a task at its start."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from manipose_mj.errors import InputError


def render(
    task: Annotated[Positional[str], arg(metavar="TASK")],
    /,
    *,
    out: Annotated[Path, arg(metavar="FILE.png")],
    seed: int = 0,
    camera: str = "overview",
    height: int = 480,
    width: int = 640,
    objects: Annotated[tuple[str, ...], arg(aliases=("--object",), metavar="NAME|DIR...")] = (),
) -> None:
    """Save a picture of a task at the start of an episode.

    Args:
      task: The task, as `manipose list` names it.
      out: The picture's file; its ending chooses the format.
      seed: Seed of the episode.
      camera: Name of a camera of the scene.
      height: Height in pixels.
      width: Width in pixels.
      objects: What to use instead of the task's own objects: names of built-in ones, asset folders, or
        folders of asset folders.
    """
    from manipose_mj.cli.evaluate import check_names

    if height < 1 or width < 1:
        raise InputError(f"a picture of {width} x {height} pixels has nothing to show")
    check_names((task,), objects)
    from PIL import Image

    formats = Image.registered_extensions()
    if formats.get(out.suffix.lower()) not in Image.SAVE:
        raise InputError(f"{out}: no picture format has this ending; try .png")
    from manipose_mj.console import output
    from manipose_mj.evaluation.episode import start_state
    from manipose_mj.mjcf.cameras.pictures import render as draw
    from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

    episode = EpisodeSpec(seed)
    with output.working_on("drawing"):
        config = EnvConfig(task, obs_mode="state", objects=objects or None)
        model, data = start_state(config, episode)
        picture = draw(model, data, camera, height, width, engine="auto")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(picture).save(out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error})") from None
    output.standard_output().print(f"picture: {out}", soft_wrap=True)
