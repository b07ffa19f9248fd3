"""`manipose view`: a task in MuJoCo's window."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def view(
    task: Annotated[Positional[str], arg(metavar="TASK")],
    /,
    *,
    seed: int = 0,
    assets: Annotated[Path | None, arg(metavar="DIR")] = None,
    object_name: Annotated[str | None, arg(name="object", metavar="NAME")] = None,
) -> None:
    """Show a task in a window, in real time; the arm holds still, and the mouse can push things.

    Args:
      task: The task, as `manipose list` names it.
      seed: Seed of the first episode; when one is over, the next begins.
      assets: Folder of built assets to take objects from instead of the built-in ones.
      object_name: The one object to show, by its asset's name.
    """
    from manipose_mj.cli.evaluate import check_names
    from manipose_mj.mjcf.viewer import open_viewer, require_display

    check_names((task,), assets, object_name)
    require_display()
    import numpy as np

    from manipose_mj.control.episode import load_environment
    from manipose_mj.mjcf.panda import HOME, MAX_OPENING

    environment = load_environment(task, assets=assets, object_name=object_name)
    environment.random_state.seed(seed)
    environment.reset()
    action = np.append(HOME, MAX_OPENING)
    physics = environment.physics
    with open_viewer(physics.model.ptr, physics.data.ptr) as window:
        while window.is_running():
            due = time.monotonic() + environment.control_timestep()
            with window.lock():
                environment.step(action)
            window.sync()
            time.sleep(max(0.0, due - time.monotonic()))
