"""`manipose demos record`: successes of the baseline, for learners."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from manipose_mj.console.process import CORES, one_thread_per_process
from manipose_mj.errors import InputError


def record_demos(
    tasks: Annotated[Positional[tuple[str, ...]], arg(metavar="TASK...", help_behavior_hint="")],
    /,
    *,
    out: Annotated[Path, arg(metavar="DIR")],
    episodes: int = 100,
    seed: int = 1,
    jobs: int = CORES,
    resume: Annotated[bool, arg(help_behavior_hint="")] = False,
    failures: Annotated[bool, arg(help_behavior_hint="")] = False,
    objects: Annotated[tuple[str, ...], arg(metavar="NAME|DIR...", help_behavior_hint="")] = (),
) -> int:
    """Record demonstrations of the baseline with true poses, on training objects, at 50 Hz.

    Args:
      tasks: Tasks to record, as `manipose list` names them.
      out: Folder; every task gets one in it.
      episodes: Successes per task.
      seed: Base seed; each attempt derives its own from it, as episodes of manipose evaluate do.
      jobs: Attempts at the same time, one core each; recordings do not depend on it.
      resume: Go on after an interruption.
      failures: Keep failed attempts too, labelled with the stage that failed.
      objects: What to draw from instead of all built-in objects for training: names of built-in ones, asset
        folders, or folders of asset folders.
    """
    one_thread_per_process()
    from manipose_mj.assets.categories import category_row, find
    from manipose_mj.cli.builtin_objects import load_objects
    from manipose_mj.cli.evaluate import check_names
    from manipose_mj.console import output
    from manipose_mj.demos.record import RecordConfig, record

    if not tasks:
        raise InputError("no task given; `manipose list` names them")
    named = check_names(tasks, objects)
    for name in named:
        category, index = find(name)
        if category_row(category).split(index) == "test":
            raise InputError(f"{name} is a test object; demonstrations take training objects")
    configs = [
        RecordConfig(task, out, episodes, seed, failures, jobs, objects or None) for task in tasks
    ]
    load_objects(named, jobs)
    console = output.standard_output()
    for config in configs:
        with output.Progress(f"demonstrations of {config.task}") as progress:

            def show(done: int, total: int) -> None:
                progress.update(done, total, "succeeded")

            demos = record(config, resume=resume, on_progress=show)
        size = demos.path.stat().st_size / 1e6
        console.print(
            f"{config.task}: {len(demos.episodes)} episodes, {size:.1f} MB: {demos.path}",
            soft_wrap=True,
        )
    return 0
