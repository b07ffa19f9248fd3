"""`manipose assets grasps`: how surely does each grasp hold?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from manipose_mj.console.process import CORES, prepare_workers


def try_grasps(
    path: Annotated[Positional[Path], arg(metavar="DIR[/NAME]")],
    /,
    *,
    engine: Literal["auto", "c", "warp"] = "auto",
    frictions: tuple[float, ...] = (0.4, 0.6, 0.8, 1.0),
    places: int = 4,
    seed: int = 0,
    jobs: int = CORES,
) -> None:
    """Close, lift and shake every grasp of rigid assets under several frictions, with the hand at its place and beside it.

    Writes grasp_survival.json beside each grasps.json: of each grasp the share of its trials in which it held.

    Args:
      path: An asset's folder, or a folder of assets.
      engine: warp, all trials at once on an NVIDIA GPU; c, on the CPU; auto, the former where it runs.
      frictions: Of the pads; 1.0 is what assets are built with.
      places: Of the hand for each grasp: the grasp itself, and others that miss it by 3 mm and 3 deg a direction (standard deviations).
      seed: Of these errors.
      jobs: Processes of the engine c.
    """
    prepare_workers(jobs)
    import numpy as np
    from rich.table import Table

    from asset_pipeline.grasp_survival.grid import GridConfig
    from asset_pipeline.grasp_survival.survival import (
        available_engine,
        grasp_survival,
        rigid_assets,
        write_survival,
    )
    from manipose_mj.console import output

    config = GridConfig(frictions, places, seed=seed)
    chosen = available_engine(engine)
    assets = rigid_assets(path)
    table = Table("asset", "grasps", "trials", "held", "surest", "no room")
    for column in table.columns[1:]:
        column.justify = "right"
    with output.Progress("assets") as progress:
        for done, asset in enumerate(assets, start=1):
            found = grasp_survival(asset, chosen, config, jobs=jobs)
            write_survival(asset, found, config)
            known = found.probability[~np.isnan(found.probability)]
            trials = len(found) * len(frictions) * places
            table.add_row(
                asset.name,
                str(len(found)),
                str(trials),
                f"{known.mean():.0%}" if len(known) else "-",
                f"{known.max():.0%}" if len(known) else "-",
                str(trials - int(found.trials.sum())),
            )
            progress.update(done, len(assets), asset.name)
    output.standard_output().print(table)
