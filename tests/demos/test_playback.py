"""What `RecordedPolicy` says of episodes that it cannot play."""

from __future__ import annotations

import numpy as np
import pytest

import manipose_mj.demos.record as recording
from manipose_mj.demos.playback import RecordedPolicy
from manipose_mj.demos.record import record
from manipose_mj.errors import InputError
from manipose_mj.evaluation.config import episode_seed
from manipose_mj.policies import ActionSpace
from tests.demos.recordings import TASK, attempting, config

SPACE = ActionSpace(-np.ones(8), np.ones(8), "pd_joint_pos", 50.0)


def refusal(policy: RecordedPolicy, task: str, episode: int) -> str:
    """What it says of an episode of base seed 1."""
    with pytest.raises(InputError) as refused:
        policy.reset(
            task=task, instruction="Do it.", seed=episode_seed(1, task, episode), action_space=SPACE
        )
    return str(refused.value)


@pytest.mark.parametrize(("failures", "count"), [(True, 4), (False, 3)])
def test_an_episode_that_is_not_recorded_is_told_with_how_many_are(
    failures, count, tmp_path, monkeypatch
):
    """Attempt 1 fails."""
    monkeypatch.setattr(recording, "_attempt", attempting)
    record(config(tmp_path, episodes=3, failures=failures))
    policy = RecordedPolicy(str(tmp_path))
    seed = episode_seed(1, TASK, 9)
    assert refusal(policy, TASK, 9) == (
        f"{tmp_path}: holds no recording of {TASK} with seed {seed}, but {count} with others; take the recording's "
        f"--seed and at most {count} --episodes, fewer where attempts failed (--failures keeps those), or add some by "
        "`manipose demos record --resume`"
    )


def test_a_task_that_is_not_recorded_is_told_with_those_that_are(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "_attempt", attempting)
    record(config(tmp_path, episodes=1))
    assert refusal(RecordedPolicy(str(tmp_path)), "clutter/pick", 0) == (
        f"{tmp_path}: holds no recording of clutter/pick; it has {TASK}"
    )
