"""Record what episodes do, and compare two records bit by bit: nothing may change while code is moved.

    python benchmarks/behaviour.py record OUT [--episodes 3] [--jobs 2] [--only clutter/pick]
    python benchmarks/behaviour.py compare BEFORE AFTER

A record holds, for every task, the results and trajectories of a few episodes of the baseline with true
poses; for every task again, a few random steps with every observation mode, dense reward and strong
randomisation; those of the first task in every control mode; an episode on estimated poses; and the pose estimates
of two categories. Floats are kept as hashes of their bytes. Times are left out.
"""

from __future__ import annotations

import hashlib
import json
import logging
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import joblib
import numpy as np
import tyro

from manipose_mj import suite
from manipose_mj.control.perception.pose_sources import sensors_for
from manipose_mj.errors import InputError, check_count
from manipose_mj.evaluation.episode import run_episode
from manipose_mj.storage.staging import staging
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.registry import tasks_named

OBSERVATIONS = "state+pose+rgb+depth+segmentation+pointcloud"
CONTROL_MODES = (
    "pd_joint_pos",
    "pd_joint_delta_pos",
    "pd_joint_target_delta_pos",
    "pd_joint_vel",
    "pd_joint_pos_vel",
    "pd_joint_delta_pos_vel",
    "pd_ee_pose",
    "pd_ee_delta_pos",
    "pd_ee_delta_pose",
    "pd_ee_target_delta_pos",
    "pd_ee_target_delta_pose",
)
ESTIMATED = "single_object/target_pose"
CATEGORIES = ("bowl", "mug")
RANDOM_STEPS = 6
_NAMED = 5  # entries that are in one file only


def digest(array: object) -> str:
    """Shape, type and bytes of an array, as a short hash."""
    values = np.ascontiguousarray(array)
    head = f"{values.shape}{values.dtype}".encode()
    return hashlib.sha256(head + values.tobytes()).hexdigest()[:16]


def played(task: str, episode: int, pose: str) -> dict[str, Any]:
    """An episode of the baseline."""
    logging.getLogger("absl").setLevel(logging.ERROR)
    config = EnvConfig(task, obs_mode="state", sensors=sensors_for(pose))
    spec = EpisodeSpec(1000 + episode)
    result, trajectory = run_episode(config, spec, episode=episode, pose=pose)
    row = asdict(result)
    del row["wall_s"], row["policy_s"]
    row["trajectory"] = digest(trajectory.qpos)
    row["annotations"] = trajectory.annotations[-1]
    return row


def wandered(task: str, control_mode: str) -> dict[str, Any]:
    """Random steps: what is observed and rewarded."""
    domain, _, name = task.partition("/")
    environment = suite.load(
        domain,
        name,
        seed=7,
        obs_mode=OBSERVATIONS if control_mode == "pd_joint_pos" else "state+pose",
        control_mode=control_mode,
        reward_mode="dense",
        randomisation="strong",
    )
    spec, rng = environment.action_spec(), np.random.default_rng(0)
    low, high = np.maximum(spec.minimum, -1.0), np.minimum(spec.maximum, 1.0)
    steps = [environment.reset()]
    steps += [environment.step(rng.uniform(low, high)) for _ in range(RANDOM_STEPS)]
    return {
        "rewards": [step.reward for step in steps[1:]],
        "observations": {
            key: digest([step.observation[key] for step in steps]) for key in steps[0].observation
        },
    }


def estimated(category: str) -> dict[str, Any]:
    """The shipped estimator on views of test objects."""
    from manipose_mj.ppf_jax.data.view_cache import catalogue_clouds
    from manipose_mj.ppf_jax.data.view_settings import view_setting
    from manipose_mj.ppf_jax.estimator import PoseEstimator
    from manipose_mj.ppf_jax.evaluation.pose_predictions import predict

    clouds = catalogue_clouds(category, "test", view_setting("anywhere"), views=2)
    found = predict(PoseEstimator.load(category), clouds)
    return {"clouds": digest(clouds[0].points), "poses": digest(found.poses)}


def record(
    out: Annotated[Path, tyro.conf.Positional],
    episodes: int = 3,
    jobs: int = 2,
    only: tuple[str, ...] = (),
) -> None:
    """Write a record.

    Args:
      out: JSON file.
      episodes: Of each task.
      jobs: Processes.
      only: Tasks, or patterns of them such as `clutter/*`; all by default.

    Raises:
      InputError: The file cannot be written, a task is unknown, or a number is below 1.
    """
    check_count("episodes", episodes, least=1)
    check_count("jobs", jobs, least=1)
    if out.is_dir() or not out.parent.is_dir():
        raise InputError(f"{out}: cannot be written; expected a file in a folder that exists")
    tasks = tasks_named(only or ("*",))
    calls: dict[str, Any] = {}
    for task in tasks:
        for episode in range(episodes):
            calls[f"episode {task} {episode}"] = joblib.delayed(played)(task, episode, "oracle")
        calls[f"steps {task} pd_joint_pos"] = joblib.delayed(wandered)(task, "pd_joint_pos")
    for mode in CONTROL_MODES[1:]:
        calls[f"steps {tasks[0]} {mode}"] = joblib.delayed(wandered)(tasks[0], mode)
    if not only:
        calls[f"estimated {ESTIMATED}"] = joblib.delayed(played)(ESTIMATED, 0, "estimated")
        for category in CATEGORIES:
            calls[f"poses {category}"] = joblib.delayed(estimated)(category)
    with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
        rows = joblib.Parallel(n_jobs=jobs, verbose=1)(calls.values())
    document = dict(zip(calls, rows, strict=True))
    with staging(out) as scratch:
        whole = scratch / out.name
        whole.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        whole.replace(out)


def compare(
    before: Annotated[Path, tyro.conf.Positional], after: Annotated[Path, tyro.conf.Positional]
) -> None:
    """Print what differs or is in one file only; exit with 1 if anything does.

    Raises:
      InputError: A file is no record.
    """
    old, new = _read(before), _read(after)
    shared = [key for key in old if key in new]
    differing = [key for key in shared if old[key] != new[key]]
    for key in differing:
        fields = sorted({*old[key], *new[key]})
        names = [name for name in fields if old[key].get(name) != new[key].get(name)]
        print(f"{key}: {', '.join(names)}")
    missing = sorted({*old} ^ {*new})
    print(
        f"{len(shared) - len(differing)} of {len(shared)} equal; in one file only: {len(missing)}"
    )
    for key in missing[:_NAMED]:
        print(f"only in {before if key in old else after}: {key}")
    raise SystemExit(1 if differing or missing or not shared else 0)


def _read(path: Path) -> dict[str, dict[str, Any]]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}; expected a record") from None
    if not isinstance(document, dict) or not all(isinstance(r, dict) for r in document.values()):
        raise InputError(f"{path}: is no record of episodes")
    return document


def main() -> None:
    """Record or compare; what cannot be used is one line, with exit code 2."""
    try:
        tyro.extras.subcommand_cli_from_dict({"record": record, "compare": compare})
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None


if __name__ == "__main__":
    main()
