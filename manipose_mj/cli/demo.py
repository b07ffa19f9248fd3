"""`manipose demo`: the whole benchmark in small."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from manipose_mj.cli.evaluate import CORES, one_thread_per_process, run_and_report

EPISODES = 4


def demo(
    *,
    out: Annotated[Path, arg(metavar="DIR")] = Path("demo_report"),
    jobs: int = CORES,
) -> int:
    """Run a few episodes of every task and write a report with pictures.

    Args:
      out: Folder for the report; an earlier demo in it is replaced.
      jobs: Episodes at the same time, one core each.
    """
    one_thread_per_process()
    from manipose_mj.evaluation.config import EvaluationConfig
    from manipose_mj.suite import ALL_TASKS

    tasks = tuple("/".join(task) for task in ALL_TASKS)
    config = EvaluationConfig(tasks, out, episodes=EPISODES, jobs=jobs)
    _forget_earlier_demo(config)
    return run_and_report(config, resume=False)


def _forget_earlier_demo(config) -> None:
    """Drop the results of the same demo; anything else in the folder stays, and is refused later."""
    from manipose_mj.evaluation.runner import RESULTS_FILE, RUN_FILE

    try:
        before = json.loads((config.out / RUN_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return
    if all(before.get(name) == value for name, value in config.identity.items()):
        (config.out / RESULTS_FILE).unlink(missing_ok=True)
