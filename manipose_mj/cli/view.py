"""`manipose view`: a task in MuJoCo's window."""

from __future__ import annotations

import time
from typing import Annotated

from tyro.conf import Positional, arg


def view(
    task: Annotated[Positional[str], arg(metavar="TASK")],
    /,
    *,
    seed: int = 0,
    objects: Annotated[tuple[str, ...], arg(metavar="NAME|DIR...")] = (),
) -> None:
    """Show a task in a window, in real time; the arm holds still, and the mouse can push things.

    Args:
      task: The task, as `manipose list` names it.
      seed: Seed of the first episode; when one is over, the next begins.
      objects: What to use instead of the task's own objects: names of built-in ones, asset folders, or
        folders of asset folders.
    """
    from manipose_mj.cli.evaluate import check_names
    from manipose_mj.mjcf.views.viewer import open_viewer, require_display

    check_names((task,), objects)
    require_display()
    import numpy as np

    from manipose_mj import suite
    from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
    from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

    episode = EpisodeSpec(seed)
    environment = suite.make(EnvConfig(task, obs_mode="state", objects=objects or None))
    environment.reset(episode)
    action = np.append(HOME, MAX_OPENING)
    physics = environment.physics
    with open_viewer(physics.model.ptr, physics.data.ptr) as window:
        while window.is_running():
            due = time.monotonic() + environment.control_timestep()
            with window.lock():
                environment.step(action)
            window.sync()
            time.sleep(max(0.0, due - time.monotonic()))
