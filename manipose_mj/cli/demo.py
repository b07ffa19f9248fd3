"""`manipose demo`: the whole benchmark in small."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from manipose_mj.cli.evaluate import run_and_report
from manipose_mj.console.process import CORES, prepare_workers
from manipose_mj.errors import InputError

# Of every family, the paper's experiments first.
TASKS = (
    "articulated/store_chips_can_middle_drawer",
    "articulated/open_cabinet_door",
    "clutter/pick",
    "single_object/reorient_mug",
    "single_object/target_pose",
)
EPISODES = 4
MARK = ".demo"


def demo(
    *,
    out: Annotated[Path, arg(metavar="DIR")] = Path("demo_report"),
    jobs: int = CORES,
) -> int:
    """Run the protocol's first episodes of tasks of every family and write a report with pictures.

    Args:
      out: Folder for the report; an earlier demo in it is replaced.
      jobs: Episodes at the same time, one core each.
    """
    prepare_workers(jobs)
    from manipose_mj.cli.builtin_objects import load_objects, names_in_protocol
    from manipose_mj.evaluation.config import EvaluationConfig
    from manipose_mj.evaluation.protocol import VERSIONS
    from manipose_mj.mjcf.panda.robot import picture_visuals

    config = EvaluationConfig(TASKS, out, episodes=EPISODES, jobs=jobs, protocol=VERSIONS[0])
    picture_visuals()  # refuses a wrong folder before anything is built or replaced
    _claim(out)
    load_objects(names_in_protocol(VERSIONS[0], TASKS, EPISODES), jobs)
    return run_and_report(config, resume=False)


def _claim(out: Path) -> None:
    """Drop an earlier demo's results and mark the folder as a demo's.

    Raises:
      InputError: Another demo or evaluation is writing there, nobody can, or there are results of something else.
    """
    from manipose_mj.evaluation.results_folder import results_file

    mark = out / MARK
    with results_file(out) as file:
        if mark.exists():
            file.truncate(0)
            return
        if os.fstat(file.fileno()).st_size:
            raise InputError(f"{out}: holds results that are not a demo's; choose another --out")
        mark.write_text("`manipose demo` replaces the results in this folder.\n", encoding="utf-8")
