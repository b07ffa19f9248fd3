"""Plot the dense reward along the baseline's successes, one panel for each task.

python benchmarks/pictures/reward_curves.py --out rewards.png [--only TASK ...] [--episodes 3] [--jobs N]

Prints, for each success, the rank correlation of reward and time and by how much it falls on the way.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib
import numpy as np
from joblib import Parallel, delayed
from scipy.stats import spearmanr

from manipose_mj import suite
from manipose_mj.control.baseline import Baseline
from manipose_mj.failures import StageFailure

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402


def main() -> None:
    """Run the oracle baseline, plot, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", nargs="+", default=[], help="domain/task")
    parser.add_argument("--episodes", type=int, default=3, help="seeds to try")
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    tasks = [t for t in suite.ALL_TASKS if not arguments.only or "/".join(t) in arguments.only]
    columns = min(4, len(tasks))
    rows = -(-len(tasks) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(4 * columns, 2.5 * rows), squeeze=False, sharey=True
    )
    seeds = range(arguments.episodes)
    found: list[np.ndarray | None] = Parallel(n_jobs=arguments.jobs)(
        delayed(_rewards)(task, seed) for task in tasks for seed in seeds
    )
    curves = iter(found)
    for axis, task in zip(axes.ravel(), tasks, strict=False):
        axis.set_title("/".join(task), fontsize=8)
        axis.set_ylim(0, 1.02)
        for seed in seeds:
            rewards = next(curves)
            if rewards is None:
                print(f"{'/'.join(task)} seed {seed}: no success")
                continue
            seconds = 0.02 * np.arange(len(rewards))
            axis.plot(seconds, rewards)
            falls = -np.minimum(np.diff(rewards), 0.0)
            print(
                f"{'/'.join(task)} seed {seed}: rank correlation {spearmanr(seconds, rewards).statistic:.2f}, "
                f"falls by {falls.sum():.2f} in all, by {falls.max():.2f} at most at once"
            )
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    figure.tight_layout()
    figure.savefig(arguments.out, dpi=110)


def _rewards(task: tuple[str, str], seed: int) -> np.ndarray | None:
    """The rewards of an episode; None if it fails."""
    environment = suite.load(*task, seed=seed, obs_mode="state", reward_mode="dense")
    environment.reset()
    rewards = []
    try:
        for action in Baseline(environment).actions(seed):
            step = environment.step(action)
            rewards.append(step.reward)
            if step.last():
                break
    except StageFailure:
        return None
    return np.array(rewards) if environment.task.success_now else None


if __name__ == "__main__":
    main()
