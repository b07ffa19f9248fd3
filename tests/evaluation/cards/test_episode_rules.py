"""A result that cannot be under a protocol is told from one that can."""

from __future__ import annotations

from dataclasses import replace

import pytest

from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.cards.episode_rules import broken_rules
from manipose_mj.evaluation.cards.run_record import read_run
from manipose_mj.evaluation.records import from_line
from tests.evaluation.cards.test_edited_runs import edited_success
from tests.evaluation.cards.test_edited_runs import run as run
from tests.evaluation.cards.test_edited_runs import whole as whole
from tests.places import ROOT

V1 = protocol.load("v1")
LINES = (ROOT / "leaderboard/baseline_true_poses/runs/0/results.jsonl").read_text().splitlines()


def first(task: str, **changes):
    """The published first result of a task, changed, and what is wrong about it."""
    result = next(r for r in map(from_line, LINES) if (r.task, r.episode) == (task, 0))
    assert result.success_at_end
    changed = replace(result, **changes)
    return list(broken_rules(V1.task(task), V1.episode(task, 0), changed))


@pytest.mark.parametrize(
    ("task", "changes", "said"),
    [
        ("single_object/target_pose", {"translation_error": 0.021}, "translation_error 0.021"),
        ("single_object/target_pose", {"rotation_error": 0.3}, "rotation_error 0.3; the protocol"),
        ("single_object/target_pose", {"object": ""}, "succeeds and is about no object"),
        ("single_object/target_pose", {"reason": "slipped"}, "the reason 'slipped' for a failure"),
        ("single_object/target_pose", {"object": "mug_999"}, "is about mug_999; the protocol has"),
        ("articulated/open_oven", {"object": "oven_999"}, "is about oven_999; the protocol has"),
        ("articulated/store_oven", {"object": "toy_car_999"}, None),
        ("articulated/open_oven", {"steps": 2001}, None),
        ("articulated/open_oven", {"steps": 2002}, "steps is 2002; its time limit of 40 s"),
        ("articulated/open_oven", {"sim_time": 41.0}, "sim_time is 41; its time limit is 40 s"),
        ("articulated/open_oven", {"steps": -1}, "steps is -1; expected 0 or more"),
        ("articulated/open_oven", {"wall_s": -0.5}, "wall_s is -0.5; expected 0 or more"),
        ("articulated/open_oven", {"sim_time": -0.5}, "sim_time is -0.5; expected 0 or more"),
    ],
)
def test_what_cannot_be_is_told(task, changes, said):
    assert not first(task)
    broken = first(task, **changes)
    assert (len(broken) == 1 and said in broken[0]) if said else not broken


def test_a_run_with_such_a_result_is_refused(run):
    path, number = edited_success(run, steps=-1)
    with pytest.raises(InputError) as refusal:
        read_run(run)
    assert str(refusal.value).startswith(f"{path}: episode {number} of ")
    assert str(refusal.value).endswith(": steps is -1; expected 0 or more")
