"""The baseline plans and looks by the tolerance of its task, not by that of this package's tasks."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from manipose_mj.control.baseline import Baseline
from manipose_mj.control.execution.executor import Executor
from manipose_mj.control.planning.planner import RulePlanner
from manipose_mj.errors import InputError
from manipose_mj.failures import StageFailure
from manipose_mj.poses import compose, invert
from manipose_mj.tasks.goals import Tolerance
from tests.few_objects import load

OWN = Tolerance(translation=0.05)


class Asked(RulePlanner):
    """Remembers the tolerance that it was asked for plans with, and has none."""

    tolerance: Tolerance | None = None

    def candidates(self, goals, estimate, planner, tolerance):
        self.tolerance = tolerance
        raise InputError("no plan")


@pytest.fixture(scope="module")
def environment():
    made = load("single_object", "target_pose", 1, obs_mode="state", objects=("mug_000",))
    made.reset()
    return made


def test_planners_are_told_the_tolerance_of_the_task(environment, monkeypatch):
    task, planner = environment.task, Asked()
    monkeypatch.setattr(task, "config", replace(task.config, tolerance=OWN))
    with pytest.raises(StageFailure, match="no plan"):
        next(Baseline(environment, planner=planner).actions(0))
    assert planner.tolerance == OWN


@pytest.mark.parametrize(
    ("off", "tolerance", "short"),
    [(0.04, OWN, False), (0.04, Tolerance(), True), (0.01, Tolerance(translation=0.005), True)],
)
def test_a_plan_falls_short_by_the_tolerance_of_the_task(
    environment, monkeypatch, off, tolerance, short
):
    task, baseline = environment.task, Baseline(environment)
    monkeypatch.setattr(task, "config", replace(task.config, tolerance=tolerance))
    monkeypatch.setattr(baseline, "_pose", "estimated")  # with true poses the task is asked
    estimate = baseline.perception.observe()
    goal, obj = task.goals[0].pose, estimate.objects["object"]
    place = compose(goal[:3, :3], goal[:3, 3] + [off, 0.0, 0.0])
    lying = replace(obj, pose=place @ invert(obj.label.pose))
    seen = replace(estimate, objects={"object": lying})
    perception = SimpleNamespace(
        robot=baseline.perception.robot, observe=lambda: seen, feels_joints=False
    )
    executor = Executor(perception, task.control_timestep)
    assert baseline._falls_short(executor) is short
