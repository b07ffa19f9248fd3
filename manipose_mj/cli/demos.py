"""`manipose demos`: record demonstrations, replay and export them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from manipose_mj.console.command_line import CommandApp
from manipose_mj.console.process import CORES, one_thread_per_process, prepare_workers
from manipose_mj.errors import InputError


def build_app() -> CommandApp:
    """The commands under `manipose demos`."""
    app = CommandApp()
    app.add("record", record_demos)
    app.add("replay", replay_demos)
    app.add("export", export_demos)
    return app


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
    objects: Annotated[
        tuple[str, ...], arg(aliases=("--object",), metavar="NAME|DIR...", help_behavior_hint="")
    ] = (),
) -> int:
    """Record demonstrations of the baseline with true poses, on training objects, at 50 Hz.

    Args:
      tasks: Tasks to record, as `manipose list` names them, or patterns such as "single_object/*".
      out: Folder; every task gets one in it.
      episodes: Successes per task.
      seed: Base seed; each attempt derives its own from it, as episodes of manipose evaluate do.
      jobs: Attempts at the same time, one core each; recordings do not depend on it.
      resume: Go on after an interruption, or with more episodes than are there.
      failures: Keep failed attempts too, labelled with the stage that failed.
      objects: What to draw from instead of all built-in objects for training: names of built-in ones, asset
        folders, or folders of asset folders.
    """
    prepare_workers(jobs)
    from manipose_mj.cli.builtin_objects import load_objects
    from manipose_mj.cli.evaluate import check_names
    from manipose_mj.console import output
    from manipose_mj.demos.layout import refuse_test_objects
    from manipose_mj.demos.record import RecordConfig, record
    from manipose_mj.tasks import registered  # noqa: F401  (registers the tasks)
    from manipose_mj.tasks.core.registry import tasks_named

    if not tasks:
        raise InputError("no task given; `manipose list` names them")
    tasks = tasks_named(tasks)
    named = check_names(tasks, objects)
    refuse_test_objects(objects)  # before any is built
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


def replay_demos(
    data: Annotated[Positional[Path], arg(metavar="DIR|FILE.h5")],
    /,
    *,
    obs_mode: Annotated[str, arg(metavar="MODES", help_behavior_hint="")] = "",
    control_mode: Annotated[str, arg(metavar="MODE")] = "pd_joint_pos",
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None,
    resume: Annotated[bool, arg(help_behavior_hint="")] = False,
    jobs: int = CORES,
) -> int:
    """Replay demonstrations: without options to see that they repeat bit for bit.

    Args:
      data: What manipose demos record wrote: its folder, that of a task, or a file.
      obs_mode: Observations to add, joined by +, such as rgb+pointcloud.
      control_mode: To convert the actions into.
      out: Folder for the new files; those that do not succeed any more are left out.
      resume: Leave out what is in new files already: whole tasks, or the first episodes of a set that has grown.
      jobs: Episodes at the same time, one core each.
    """
    prepare_workers(jobs)
    from manipose_mj.console import output
    from manipose_mj.demos.layout import find_sets
    from manipose_mj.demos.replay import (
        ReplayConfig,
        differing_versions,
        lost,
        replay,
        replayed_before,
    )

    if resume and out is None:
        raise InputError("--resume needs --out: the folder of the new files")
    config = ReplayConfig(obs_mode, control_mode, out, jobs)
    console, notes = output.standard_output(), output.standard_error()
    worst = 0
    for demos in find_sets(data):
        before = replayed_before(demos, config) if resume else None
        if before is not None:
            console.print(
                f"{demos.task}: {len(before.episodes)} are there already: {before.path}",
                soft_wrap=True,
            )
            if before.replayed == len(demos.episodes):
                continue
        if changed := differing_versions(demos):
            notes.print(f"{demos.task}: recorded with other versions: {', '.join(changed)}")
        with output.Progress(f"replays of {demos.task}") as progress:

            def show(done: int, total: int) -> None:
                progress.update(done, total, "replayed")

            results = replay(demos, config, before, on_progress=show)
        same = sum(each.identical for each in results)
        wins = sum(each.success for each in results)
        repeats = "" if out is not None else f"{same} bit for bit, "
        console.print(
            f"{demos.task}: {len(results)} replayed, {repeats}{wins} succeed, "
            f"{lost(results)} successes lost",
            soft_wrap=True,
        )
        if out is None and not changed and same < len(results):
            names = ", ".join(
                f"traj_{each.episode.episode_id}" for each in results if not each.identical
            )
            notes.print(f"{demos.path}: not bit for bit: {names}", soft_wrap=True)
        worst = max(worst, int(out is None and not changed and same < len(results)))
    return worst


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
