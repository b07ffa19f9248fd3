"""What the tests of demonstrations record: few episodes of a quick task, on three objects."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from manipose_mj.demos.record import RecordConfig

TASK = "single_object/target_pose"
OBJECTS = ("mug_000", "chips_can_000", "box_000")


def config(out: Path, **options: Any) -> RecordConfig:
    return RecordConfig(TASK, out, **{"episodes": 2, "objects": OBJECTS, **options})


def attempting(config, number, seed):
    """Instead of an episode: every third attempt fails."""
    stage = "grasp" if number % 3 == 1 else None
    arrays = recording_arrays(np.full((number + 1, 8), float(number)))
    write_attempt(config, number, seed, stage, arrays)
    return stage is None


def recording_arrays(actions):
    from manipose_mj.demos.layout import DemoArrays

    states = np.zeros((len(actions) + 1, 3), np.float32)
    return DemoArrays(actions, states, states, np.ones(len(actions), bool), False)


def write_attempt(config, number, seed, stage, arrays):
    from manipose_mj.demos.attempts import attempt_file
    from manipose_mj.demos.layout import write_episode, writing

    path = attempt_file(config.parts, number)
    if stage is None or config.failures:
        with writing(path.with_suffix(".h5")) as file:
            write_episode(file, number, arrays)
    path.write_text(
        json.dumps(
            {
                "episode_id": number,
                "episode_seed": seed,
                "control_mode": "pd_joint_pos",
                "elapsed_steps": number + 1,
                "success": stage is None,
                "failure": stage,
                "object": "mug_000",
                "instruction": "Do it.",
                "state_sha256": "",
                "reset_kwargs": {"seed": seed},
            }
        )
    )
