"""`manipose demos replay`: repeat demonstrations, add observations, convert actions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from manipose_mj.console.process import CORES, one_thread_per_process


def replay_demos(
    data: Annotated[Positional[Path], arg(metavar="DIR|FILE.h5")],
    /,
    *,
    obs_mode: Annotated[str, arg(metavar="MODES", help_behavior_hint="")] = "",
    control_mode: Annotated[str, arg(metavar="MODE")] = "pd_joint_pos",
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None,
    jobs: int = CORES,
) -> int:
    """Replay demonstrations: without options to see that they repeat bit for bit.

    Args:
      data: What manipose demos record wrote: its folder, that of a task, or a file.
      obs_mode: Observations to add, joined by +, such as rgb+pointcloud.
      control_mode: To convert the actions into.
      out: Folder for the new files; those that do not succeed any more are left out.
      jobs: Episodes at the same time, one core each.
    """
    one_thread_per_process()
    from manipose_mj.console import output
    from manipose_mj.demos.layout import find_sets
    from manipose_mj.demos.replay import ReplayConfig, differing_versions, lost, replay

    config = ReplayConfig(obs_mode, control_mode, out, jobs)
    console, notes = output.standard_output(), output.standard_error()
    worst = 0
    for demos in find_sets(data):
        if changed := differing_versions(demos):
            notes.print(f"{demos.task}: recorded with other versions: {', '.join(changed)}")
        with output.Progress(f"replays of {demos.task}") as progress:

            def show(done: int, total: int) -> None:
                progress.update(done, total, "replayed")

            results = replay(demos, config, on_progress=show)
        same = sum(each.identical for each in results)
        wins = sum(each.success for each in results)
        repeats = "" if out is not None else f"{same} bit for bit, "
        console.print(
            f"{demos.task}: {len(results)} replayed, {repeats}{wins} succeed, "
            f"{lost(results)} successes lost",
            soft_wrap=True,
        )
        worst = max(worst, int(out is None and not changed and same < len(results)))
    return worst
