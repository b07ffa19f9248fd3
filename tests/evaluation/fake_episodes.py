"""A runner without a simulator, and an evaluation of it that a test can kill."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import mujoco
import numpy as np

from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.records import EpisodeResult, Trajectory
from manipose_mj.failures import STAGES

TASKS = ("single_object/target_pose", "articulated/store_chips_can_middle_drawer")


def make_runner(seconds: float = 0.0, diary: Path | None = None):
    """A runner whose outcome follows from the seed alone; local, so that it pickles by value.

    It takes what `run_episode` takes, and heeds the first few.
    """

    def run(config, spec, *, episode, pose, estimator=None, planner=None, errors=None, grasps=None):
        task, seed = config.task, spec.seed
        start = time.perf_counter()
        rng = np.random.default_rng(seed)
        time.sleep(seconds * rng.uniform(0.5, 1.5))
        success = bool(rng.random() < 0.8)
        stage = None if success else STAGES[rng.integers(len(STAGES))]
        result = EpisodeResult(
            task=task,
            episode=episode,
            seed=seed,
            object=config.objects[0] if config.objects else "mug",
            pose_source=pose,
            success_once=success or bool(rng.random() < 0.3),
            success_at_end=success,
            failure=stage,
            reason="" if success else f"the {stage} stage gave up",
            translation_error=float(abs(rng.normal(0, 0.006 if success else 0.08))),
            rotation_error=float(abs(rng.normal(0, 0.05 if success else 0.9))),
            steps=int(rng.integers(100, 400)),
            sim_time=float(rng.uniform(5, 20)),
            max_penetration=float(rng.uniform(0, 0.002)),
            wall_s=time.perf_counter() - start,
        )
        t = np.linspace(0, 2, 21)
        qpos = np.stack([0.3 * np.sin(t + 0.1 * episode), 0.3 * np.cos(t)], axis=1)
        names = ["move_to"] * 7 + ["grasp_at"] * 7 + ["release"] * 7
        if diary is not None:
            with diary.open("a") as file:
                file.write(f"{task} {episode}\n")
        return result, Trajectory(t, qpos.astype(np.float32), names)

    return run


def scene(config, spec) -> mujoco.MjModel:
    """A scene that fits the fake runner's trajectories: a pendulum of two links."""
    return mujoco.MjModel.from_xml_string("""
    <mujoco>
      <worldbody>
        <light pos="0 -1 3"/>
        <camera name="overview" pos="0 -2 0.4" xyaxes="1 0 0 0 0 1"/>
        <geom type="plane" size="2 2 0.1" rgba="0.8 0.8 0.75 1"/>
        <body pos="0 0 0.8">
          <joint type="hinge" axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.05" rgba="0.8 0.3 0.2 1"/>
          <body pos="0 0 -0.3">
            <joint type="hinge" axis="0 1 0"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.04" rgba="0.2 0.4 0.8 1"/>
          </body>
        </body>
      </worldbody>
    </mujoco>""")


def main(out: str, jobs: str, resume: str) -> None:
    """Forty slow episodes, for a process that is killed before they end."""
    from manipose_mj.evaluation.runner import evaluate

    config = EvaluationConfig(TASKS, Path(out), episodes=20, seed=3, jobs=int(jobs))
    evaluate(config, resume=resume == "resume", runner=make_runner(seconds=0.1))


if __name__ == "__main__":
    main(*sys.argv[1:])
