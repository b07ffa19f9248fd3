"""`manipose view`: a task in MuJoCo's window."""

from __future__ import annotations

import time
from typing import Annotated, Any

from tyro.conf import Positional, arg


def view(
    task: Annotated[Positional[str], arg(metavar="TASK")],
    /,
    *,
    seed: int = 0,
    objects: Annotated[tuple[str, ...], arg(aliases=("--object",), metavar="NAME|DIR...")] = (),
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
    from contextlib import ExitStack

    import numpy as np

    from manipose_mj import suite
    from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING, picture_visuals
    from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

    episode = EpisodeSpec(seed)
    config = EnvConfig(
        task, obs_mode="state", objects=objects or None, robot_visuals=picture_visuals()
    )
    environment = suite.make(config)
    environment.reset(episode)
    action = np.append(HOME, MAX_OPENING)
    shown: Any = None
    with ExitStack() as stack:
        while True:
            physics = environment.physics
            if physics.model.ptr is not shown:
                # Of the first episode, or of one with other objects.
                stack.close()
                shown = physics.model.ptr
                window = stack.enter_context(open_viewer(shown, physics.data.ptr))
            if not window.is_running():
                return
            due = time.monotonic() + environment.control_timestep()
            with window.lock():
                environment.step(action)
            if environment.physics.model.ptr is shown:
                window.sync()
            time.sleep(max(0.0, due - time.monotonic()))
