"""Print how many grasp trials a second engine `warp` makes, and how often engine `c` comes to the same verdicts.

python benchmarks/batch/grasp_trials.py FOLDER_OF_ASSETS [--places 4] [--jobs N] [--set jacobian=1 ...]

Every grasp of every asset is tried with four frictions and some places of the hand. Both engines try each grasp with
the hand at its place. Times are those of a second run, without compiling.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from solver_options import add_set, set_options

from asset_pipeline.build.grasp_trial import TrialConfig
from asset_pipeline.grasp_survival.engine_c import held_c
from asset_pipeline.grasp_survival.engine_warp import Batch
from asset_pipeline.grasp_survival.grid import GridConfig, trial_grid
from asset_pipeline.grasp_survival.trial_model import GridTrial
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.assets.gripper import ParallelJaw


def main() -> None:
    """Print a row for each asset, and one for all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("assets", type=Path, help="folder of asset folders")
    parser.add_argument("--places", type=int, default=4, help="of the hand for each grasp")
    parser.add_argument("--worlds", type=int, default=16384, help="at the same time")
    parser.add_argument("--jobs", type=int, default=1, help="processes of engine c")
    parser.add_argument("--most", type=int, default=50, help="assets")
    add_set(parser, "for engine warp alone")
    arguments = parser.parse_args()
    gripper, config = ParallelJaw(), TrialConfig()
    print(
        "| object | grasps | trials | held | first [s] | seconds | trials/s | no room | alike | of |"
    )
    print("|" + " --- |" * 10, flush=True)
    alike, compared, trials, seconds = 0, 0, 0, 0.0
    for folder in list_assets(arguments.assets)[: arguments.most]:
        asset = read_asset(folder)
        if asset.grasps is None or not len(asset.grasps):
            continue
        grid = trial_grid(
            asset.grasps, asset.stable_poses, gripper, GridConfig(places=arguments.places)
        )
        trial = GridTrial(asset.model_path, gripper, config)
        set_options(trial.model, arguments.set)
        started = time.perf_counter()
        batch = Batch(trial, min(arguments.worlds, len(grid)))
        batch.held(grid.part(slice(0, 1)))
        first = time.perf_counter() - started
        started = time.perf_counter()
        held, counts = batch.held(grid)
        taken = time.perf_counter() - started
        exact = grid.part(grid.exact)
        reference = held_c(asset.model_path, exact, gripper, config, arguments.jobs)
        same = (reference == held[grid.exact])[counts[grid.exact]]
        alike, compared = alike + int(same.sum()), compared + len(same)
        trials, seconds = trials + len(grid), seconds + taken
        print(
            f"| {asset.name} | {len(asset.grasps)} | {len(grid)} | {held.mean():.3f} | "
            f"{first:.1f} | {taken:.3f} | {len(grid) / taken:,.0f} | {(~counts).sum()} | {same.mean():.3f} | "
            f"{len(same)} |",
            flush=True,
        )
    print(f"all: {trials / seconds:,.0f} trials/s; alike {alike} of {compared}")


if __name__ == "__main__":
    main()
