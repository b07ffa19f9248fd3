"""`manipose demos export`: data sets of other libraries."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from manipose_mj.console.process import one_thread_per_process


def export_demos(
    data: Annotated[Positional[Path], arg(metavar="DIR|FILE.h5")],
    /,
    *,
    out: Annotated[Path, arg(metavar="DIR")],
    format: Literal["lerobot"] = "lerobot",
    hz: int = 10,
    obs_mode: str = "state+pose",
    repo_id: str = "manipose/demos",
) -> None:
    """Export demonstrations: replay them at the rate of the data set, and write those that succeed again.

    Args:
      data: What manipose demos record wrote: its folder, that of a task, or a file.
      out: Folder of the data set; must not exist.
      format: LeRobot's v3.0, by its own writer: install LeRobot beside this package.
      hz: Frames a second; targets are held in between.
      obs_mode: state+pose, state+rgb or state+pose+rgb.
      repo_id: Name of the data set.
    """
    one_thread_per_process()
    from manipose_mj.console import output
    from manipose_mj.demos.layout import find_sets
    from manipose_mj.demos.lerobot_export import ExportConfig, export

    assert format == "lerobot"
    config = ExportConfig(out, repo_id, hz, obs_mode)
    with output.Progress("episodes") as progress:

        def show(done: int, total: int) -> None:
            progress.update(done, total, "exported")

        exported = export(find_sets(data), config, on_progress=show)
    output.standard_output().print(
        f"{config.out}: {exported.episodes} episodes, {exported.frames} frames at {hz} Hz, "
        f"{exported.lost} successes lost",
        soft_wrap=True,
    )
