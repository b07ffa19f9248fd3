"""Grasp trials on the CPU, one after the other in each process."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Bool
from joblib import Parallel, delayed

from asset_pipeline.build.grasp_trial import TrialConfig
from asset_pipeline.grasp_survival.grid import TrialGrid
from asset_pipeline.grasp_survival.trial_model import GridTrial
from manipose_mj.assets.gripper import ParallelJaw

_CHUNK = 128  # trials of a task of a process


def held_c(
    model_path: Path, grid: TrialGrid, gripper: ParallelJaw, config: TrialConfig, jobs: int = 1
) -> Bool[np.ndarray, " n"]:
    """Whether the object is still where it was in the hand, by trial.

    Args:
      model_path: The object's MJCF.
      grid: The trials.
      gripper: The hand.
      config: Of a trial.
      jobs: Processes.
    """
    parts = [grid.part(slice(i, i + _CHUNK)) for i in range(0, len(grid), _CHUNK)]
    calls = (delayed(_held)(model_path, part, gripper, config) for part in parts)
    found = Parallel(n_jobs=min(jobs, max(len(parts), 1)))(calls)
    return np.concatenate([np.zeros(0, bool), *found])


def _held(
    model_path: Path, grid: TrialGrid, gripper: ParallelJaw, config: TrialConfig
) -> Bool[np.ndarray, " n"]:
    trial = GridTrial(model_path, gripper, config)
    return np.array([trial.outcome(grid, row).held(config) for row in range(len(grid))], bool)
