"""Compare LeRobot's rate of success in frozen episodes with that of `manipose evaluate`; exit code 1 if they differ.

    python rollout_parity.py --out parity

Both play the same targets, recorded from the baseline, at 10 Hz: LeRobot's own `eval_policy` in the plug-in's environments, and
`manipose evaluate --protocol v1 --stop success`. Needs what `conformance.sh` needs.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from frozen_targets import record_targets, write_targets
from lerobot.configs import PreTrainedConfig
from lerobot.envs import close_envs, make_env, make_env_pre_post_processors
from lerobot.policies import PreTrainedPolicy
from lerobot.scripts.lerobot_eval import eval_policy
from lerobot_env_manipose import ManiPoseEnvConfig
from torch import Tensor, nn

HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Arguments:
    """Attributes: out: folder for targets and results; task; protocol; episodes: the first so many; abreast: LeRobot's
    environments at once; hz: rate of the targets."""

    out: Path
    task: str = "single_object/target_pose"
    protocol: str = "v1"
    episodes: int = 10
    abreast: int = 2
    hz: int = 10


class PlayedTargets(PreTrainedPolicy):
    """Plays targets in the order of the episodes, whatever it sees.

    `reset` begins a batch of episodes, one for each environment: LeRobot calls it once before every rollout.
    """

    config_class = PreTrainedConfig
    name = "played_targets"

    def __init__(self, targets: Sequence[np.ndarray], abreast: int) -> None:
        """Keeps them.

        Args:
          targets: `(t, n)` for each episode.
          abreast: Environments at once.
        """
        nn.Module.__init__(self)  # the base class wants the configuration of a trained policy
        self._targets = [torch.from_numpy(each) for each in targets]
        self._abreast, self._first, self._step = abreast, -abreast, 0

    def reset(self) -> None:
        self._first, self._step = self._first + self._abreast, 0

    def select_action(self, batch: dict[str, Tensor], **options: Any) -> Tensor:
        numbers = range(self._first, self._first + self._abreast)
        # A last batch that is not full plays episodes that do not count.
        shown = [self._targets[number % len(self._targets)] for number in numbers]
        step, self._step = self._step, self._step + 1
        return torch.stack([each[min(step, len(each) - 1)] for each in shown])

    def get_optim_params(self) -> dict:
        raise NotImplementedError

    def forward(self, batch: dict[str, Tensor]) -> tuple[Tensor, dict | None]:
        raise NotImplementedError

    def predict_action_chunk(self, batch: dict[str, Tensor], **options: Any) -> Tensor:
        raise NotImplementedError


def lerobots_successes(
    arguments: Arguments, targets: Sequence[np.ndarray]
) -> tuple[list[bool], float]:
    """By LeRobot's evaluation: the success of each episode, and `pc_success`."""
    config = ManiPoseEnvConfig(task=arguments.task, protocol=arguments.protocol, fps=arguments.hz)
    envs = make_env(config, n_envs=arguments.abreast)
    before, after = make_env_pre_post_processors(env_cfg=config, policy_cfg=None)
    ((environments,),) = (each.values() for each in envs.values())
    info = eval_policy(
        environments,
        PlayedTargets(targets, arguments.abreast),
        env_preprocessor=before,
        env_postprocessor=after,
        preprocessor=lambda observation: observation,
        postprocessor=lambda action: action,
        n_episodes=arguments.episodes,
        start_seed=0,
    )
    close_envs(envs)
    return [each["success"] for each in info["per_episode"]], info["aggregated"]["pc_success"]


def our_successes(arguments: Arguments, targets: Path) -> list[bool]:
    """By `manipose evaluate`: the success at the end of each episode."""
    out = (arguments.out / "ours").absolute()
    words = ["evaluate", arguments.task, "--protocol", arguments.protocol, "--jobs", "1"]
    words += ["--episodes", str(arguments.episodes), "--hz", str(arguments.hz), "--stop", "success"]
    words += ["--policy", "frozen_targets:FrozenTargets", "--out", str(out)]
    words += ["--policy-args", json.dumps({"path": str(targets.absolute())})]
    command = [sys.executable, "-m", "manipose_mj.cli.main", *words]
    subprocess.run(command, cwd=HERE, check=True)
    lines = (out / "results.jsonl").read_text(encoding="utf-8").splitlines()
    results = sorted((json.loads(line) for line in lines), key=lambda each: each["episode"])
    return [each["success_at_end"] for each in results]


def main(arguments: Arguments) -> int:
    """Record, evaluate twice, compare."""
    recorded = record_targets(arguments.task, arguments.protocol, arguments.episodes, arguments.hz)
    path = arguments.out / "targets.npz"
    write_targets(path, recorded)
    theirs, rate = lerobots_successes(arguments, list(recorded.values()))
    ours = our_successes(arguments, path)
    sys.stdout.write(
        f"LeRobot's pc_success: {rate:.1f} %, {sum(theirs)} of {len(theirs)}\n"
        f"manipose evaluate, success at end: {100 * np.mean(ours):.1f} %, {sum(ours)} of {len(ours)}\n"
    )
    differing = [
        number for number, both in enumerate(zip(theirs, ours, strict=True)) if len(set(both)) > 1
    ]
    if differing:
        sys.stdout.write(f"episodes that differ: {differing}\n")
    return int(bool(differing) or abs(rate - 100 * np.mean(ours)) > 1e-6)


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Arguments)))
