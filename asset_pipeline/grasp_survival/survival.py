"""How surely each grasp of an asset holds, in a file beside `grasps.json` that readers of assets pass over."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from asset_pipeline.build.grasp_trial import TrialConfig
from asset_pipeline.grasp_survival.engine_c import held_c
from asset_pipeline.grasp_survival.engine_warp import held_warp, missing_for_warp
from asset_pipeline.grasp_survival.grid import GridConfig, TrialGrid, trial_grid
from asset_pipeline.grasp_survival.trial_model import GridTrial
from manipose_mj.assets.asset import ASSET_FILE, Asset
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.assets.json_fields import read_json, write_columns
from manipose_mj.errors import InputError

SURVIVAL_FILE = "grasp_survival.json"
Engine = Literal["c", "warp"]


@dataclass(frozen=True)
class Survival:
    """Of the grasps of an asset, in the order of its `grasps.json`.

    Attributes:
      probability: Share of a grasp's trials in which it held; NaN where none counts.
      trials: How many of its trials count.
      verdict: Whether it held with the greatest friction that was tried, the hand at its place; by default that is the
        pads' own, and the verdict that of `build.grasp_trial`.
      engine: That made them.
    """

    probability: Float[np.ndarray, " g"]
    trials: Int[np.ndarray, " g"]
    verdict: Bool[np.ndarray, " g"]
    engine: str

    def __len__(self) -> int:
        return len(self.trials)


def available_engine(name: str) -> Engine:
    """The engine of this name; of `auto` the best that runs here.

    Raises:
      InputError: It cannot run here.
    """
    if name == "c":
        return "c"
    missing = missing_for_warp()
    if name == "warp" and missing:
        raise InputError(f"engine 'warp' cannot run here: {missing}")
    return "c" if missing else "warp"


def rigid_assets(path: Path) -> list[Asset]:
    """The rigid assets with grasps of a folder of assets, or that of an asset's own folder.

    Raises:
      InputError: There is none.
    """
    folders = [path] if (path / ASSET_FILE).is_file() else list_assets(path)
    assets = [read_asset(folder) for folder in folders]
    chosen = [asset for asset in assets if asset.kind == "rigid" and asset.grasps is not None]
    if not chosen:
        raise InputError(f"{path}: holds no rigid asset with a grasps.json")
    return chosen


def grasp_survival(
    asset: Asset,
    engine: Engine = "c",
    config: GridConfig | None = None,
    *,
    jobs: int = 1,
    trial: TrialConfig | None = None,
) -> Survival:
    """Close, lift and shake every grasp of an asset in every trial of the grid.

    Args:
      asset: A rigid one.
      engine: `"c"` or `"warp"`.
      config: Which trials.
      jobs: Processes of the engine `c`.
      trial: Of a trial; None: as assets are built.

    Raises:
      InputError: The asset has no grasps to try.
    """
    if asset.kind != "rigid" or asset.grasps is None:
        raise InputError(f"{asset.folder}: has no grasps of a rigid object; expected a grasps.json")
    config, trial, gripper = config or GridConfig(), trial or TrialConfig(), ParallelJaw()
    grid = trial_grid(asset.grasps, asset.stable_poses, gripper, config)
    if engine == "warp":
        own = GridTrial(asset.model_path, gripper, trial)
        held, counts = held_warp(own, grid)
    else:
        held = held_c(asset.model_path, grid, gripper, trial, jobs)
        counts = np.ones(len(grid), bool)
    return summarised(grid, held, counts, len(asset.grasps), engine)


def summarised(
    grid: TrialGrid,
    held: Bool[np.ndarray, " n"],
    counts: Bool[np.ndarray, " n"],
    grasps: int,
    engine: str,
) -> Survival:
    """Of trials, the grasps' survival; `counts`: whether a trial's outcome does."""
    trials = np.bincount(grid.grasp[counts], minlength=grasps)
    good = np.bincount(grid.grasp[counts & held], minlength=grasps)
    with np.errstate(invalid="ignore"):
        probability = good / trials
    strongest = grid.exact & (grid.frictions == grid.frictions.max(initial=0.0))
    verdict = np.zeros(grasps, bool)
    verdict[grid.grasp[strongest & held & counts]] = True
    return Survival(probability, trials, verdict, engine)


def write_survival(asset: Asset, survival: Survival, config: GridConfig) -> Path:
    """Write the file into the asset's folder.

    Returns:
      Its path.
    """
    path = asset.folder / SURVIVAL_FILE
    head = {"engine": survival.engine, "grid": asdict(config)}
    columns = {
        "probability": [None if np.isnan(p) else round(float(p), 4) for p in survival.probability],
        "trials": survival.trials.tolist(),
        "verdict": survival.verdict.astype(int).tolist(),
    }
    write_columns(path, head, columns)
    return path


def read_survival(asset: Asset) -> Survival | None:
    """What was written beside an asset; None where nothing was.

    Raises:
      InputError: A field is missing or wrong, or the file is of other grasps.
    """
    path = asset.folder / SURVIVAL_FILE
    if not path.is_file():
        return None
    document = read_json(path)
    count = 0 if asset.grasps is None else len(asset.grasps)
    given = document.entries("probability")
    if len(given) != count:
        raise InputError(f"{path}: is of {len(given)} grasps; the asset has {count}: make it again")
    probability = np.array([np.nan if p is None else p for p in given], float)
    trials = document.array("trials", count).astype(int)
    verdict = document.array("verdict", count).astype(bool)
    return Survival(probability, trials, verdict, str(document.text("engine", "c", "warp")))
