"""`manipose pose score`: estimates in BOP's CSV against a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def score_results(
    results: Annotated[Positional[Path], arg(metavar="RESULTS.csv")],
    /,
    *,
    data: Annotated[Path, arg(metavar="DIR")],
    json: bool = False,
) -> int:
    """Score estimated poses in BOP's CSV: scene_id,im_id,obj_id,score,R,t,time, in millimetres.

    MSSD and MSPD are mean recalls over BOP's ten thresholds, ADD(-S) counts under a tenth of the diameter. A target
    without an estimate counts as missed.

    Args:
      results: The estimates; of several of one object in an image the one with the highest score counts.
      data: Data set that manipose pose export wrote, or another in BOP's layout.
      json: Print JSON, for other programs.
    """
    from rich.table import Table

    from manipose_mj.bop.dataset import read_data
    from manipose_mj.bop.results_csv import read_results
    from manipose_mj.bop.score import score
    from manipose_mj.console import output

    estimates = read_results(results)
    read = read_data(data)
    with output.Progress("targets") as progress:
        rows = score(estimates, read, source=results, progress=progress.update)
    if json:
        output.write_json(rows)
        return 0
    table = Table("by", "", title=f"{results.name}: recall")
    heads = ("n", "estimated", "MSSD", "MSPD", "ADD(-S)", "5 deg 2 cm", "10 deg 5 cm", "s an image")
    for head in heads:
        table.add_column(head, justify="right")
    shares = ("mssd", "mspd", "add_s", "recall_5deg_2cm", "recall_10deg_5cm")
    for row in rows:
        seconds = "" if row["seconds"] is None else f"{row['seconds']:.3f}"
        figures = [f"{row[share]:.3f}" for share in shares]
        table.add_row(
            str(row["by"]),
            str(row["name"]),
            str(row["n"]),
            str(row["estimated"]),
            *figures,
            seconds,
        )
    output.standard_output().print(table)
    return 0
