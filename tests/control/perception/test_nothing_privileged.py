"""`pose="estimated"` plans and acts on sensors, masks and category names: all else is denied."""

from __future__ import annotations

from dataclasses import replace

import pytest

from manipose_mj import suite
from manipose_mj.control import baseline as baseline_module
from manipose_mj.control.baseline import Baseline
from manipose_mj.control.furniture import estimated_furniture
from manipose_mj.control.perception import sensed_world
from manipose_mj.control.perception.pose_sources import sensors_for
from manipose_mj.failures import StageFailure
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.instructions.sentence import asked_parts, instruction
from tests.control.perception.denied import PrivilegedError, denied

FAMILIES = {
    "single_object/target_pose": ("cup_004",),
    "clutter/pick": ("box_010", "box_016", "chips_can_000", "chips_can_001", "drinkbox_000"),
    "articulated/store_chips_can_middle_drawer": ("cabinet_000", "chips_can_000"),
}


def an_environment(task: str, pose: str):
    config = EnvConfig(task, obs_mode="state", objects=FAMILIES[task], sensors=sensors_for(pose))
    environment = suite.make(config, 0)
    environment.reset(EpisodeSpec(1))
    return environment


def act(environment, pose: str, monkeypatch, steps: int) -> int:
    """Control steps of a baseline to whom all is denied; what is asked of it is told in words."""
    task = environment.task
    # The task's own words and goals are what the episode asks for.
    monkeypatch.setattr(baseline_module, "instruction", lambda _: instruction(task))
    for module in (estimated_furniture, sensed_world):
        monkeypatch.setattr(module, "asked_parts", lambda _: asked_parts(task))
    taken = 0
    try:
        for action in Baseline(denied(environment), pose).actions(0):
            environment.step(action)
            taken += 1
            if taken == steps:
                break
    except StageFailure:
        # An estimate may lead nowhere; what was read on the way is what counts here.
        if taken == 0:
            raise
    return taken


@pytest.mark.full
@pytest.mark.parametrize("task", FAMILIES)
def test_a_whole_episode_reads_nothing_privileged(task, monkeypatch, optimised):
    environment = an_environment(task, "estimated")
    steps = 4000 if task.startswith("articulated") else 300
    assert act(environment, "estimated", monkeypatch, steps) >= 250


@pytest.mark.full
def test_a_kind_outside_the_catalogue_is_told_by_category_and_type_alone(monkeypatch, optimised):
    environment = an_environment("single_object/target_pose", "estimated")
    cup = environment.task.object
    monkeypatch.setattr(cup, "asset", replace(cup.asset, category="beaker"))
    assert act(environment, "estimated", monkeypatch, 300) >= 250


@pytest.mark.parametrize("pose", ["oracle", "estimated_objects"])
def test_true_furniture_is_denied(pose, monkeypatch):
    environment = an_environment("articulated/store_chips_can_middle_drawer", pose)
    with pytest.raises(PrivilegedError):
        act(environment, pose, monkeypatch, 1)


def test_furniture_that_no_camera_sees_is_a_failure_of_perception(monkeypatch):
    environment = an_environment("articulated/store_chips_can_middle_drawer", "estimated")
    monkeypatch.setattr(
        type(environment.task), "furniture_masks", property(lambda _: (("cabinet", 99),))
    )
    with pytest.raises(StageFailure, match="no camera sees enough of the cabinet") as failure:
        act(environment, "estimated", monkeypatch, 1)
    assert failure.value.stage == "perception"
