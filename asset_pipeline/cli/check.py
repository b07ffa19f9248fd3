"""`manipose assets check`: does every built asset behave?"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from manipose_mj.console.process import CORES, prepare_workers
from manipose_mj.errors import InputError


def check_assets(
    directory: Annotated[Positional[Path], arg(metavar="DIR")],
    /,
    *,
    jobs: int = CORES,
) -> int:
    """Load every asset alone, compare what is seen with what touches, let it fall and rest, open what opens, and report.

    Exits with 1 if an asset misbehaves, with 2 if one cannot be read at all.

    Args:
      directory: Folder of assets, or one asset's folder.
      jobs: Assets at the same time, one core each.
    """
    prepare_workers(jobs)
    from rich.table import Table

    from asset_pipeline.checks.asset_check import CheckResult, check
    from manipose_mj.console import output

    done: list[CheckResult] = []
    with output.Progress("assets") as progress:

        def show(result: CheckResult, total: int) -> None:
            done.append(result)
            bad = sum(not r.ok for r in done)
            progress.update(len(done), total, f"{bad} failed")

        results = check(directory, jobs=jobs, progress=show)
    unreadable = {r.name: reason for r in results if (reason := _unreadable(directory, r))}
    table = Table("asset", "settles s", "sinks mm", "leans deg", "parts", "grasps", "")
    for column in table.columns[1:6]:
        column.justify = "right"
    for result in results:
        table.add_row(
            result.name,
            _number(result.settle_seconds, 1, 2),
            _number(result.penetration, 1000, 2),
            _number(result.tilt, math.degrees(1), 1),
            str(result.parts),
            str(result.grasps),
            _verdict(result),
        )
    console = output.standard_output()
    if len(unreadable) < len(results):
        console.print(table)
        console.print(f"{sum(r.ok for r in results)} of {len(results)} ok")
    for result in results:
        for reason in (unreadable[result.name],) if result.name in unreadable else result.failures:
            output.fail_line(reason if result.name in reason else f"{result.name}: {reason}")
        for remark in result.remarks:
            console.print(f"{result.name}: {remark}", soft_wrap=True, highlight=False, markup=False)
    return 2 if unreadable else int(not all(r.ok for r in results))


def _verdict(result) -> str:
    if not result.ok:
        return "failed"
    articulated = math.isnan(result.tilt)
    return "ok" if result.grasps or articulated else "ok, no grasps"


def _unreadable(directory: Path, result) -> str:
    """Why the folder of a failed result is no asset; empty if it is one."""
    from manipose_mj.assets.asset import ASSET_FILE
    from manipose_mj.assets.asset_json import read_asset

    if result.ok:
        return ""
    alone = (directory / ASSET_FILE).is_file()
    try:
        read_asset(directory if alone else directory / result.name)
    except InputError as error:
        return str(error)
    return ""


def _number(value: float, factor: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{factor * value:.{digits}f}"
