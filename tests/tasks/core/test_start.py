"""Starts that cannot be written into a scene are told before anything moves."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.registry import TaskSpec
from manipose_mj.tasks.core.scene_source import SceneSource
from manipose_mj.tasks.core.start import EpisodeStart, PlacedFurniture, PlacedObject, read_only
from manipose_mj.tasks.core.start_check import check_start
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.goals import InsideGoal, OpenGoal, OrientationGoal, PoseGoal
from tests.few_objects import load

GOALS = (PoseGoal("object", np.eye(4)),)
PLACED = {"object": PlacedObject(0, np.eye(4))}
FURNITURE = (PlacedFurniture(0, np.zeros(3), np.eye(4)[0]),)


PARTS = (("drawer",),)


def _with(valid, **fields):
    """A copy with other fields, whatever their types: a user's code is not checked as it runs."""
    changed = copy.copy(valid)
    for name, value in fields.items():
        object.__setattr__(changed, name, value)
    return changed


def _start(goals=GOALS, objects=PLACED, **more):
    return _with(EpisodeStart(GOALS, PLACED), goals=goals, objects=objects, **more)


def _object(pose, index: Any = 0):
    return {"object": _with(PLACED["object"], index=index, pose=pose)}


def _furniture(**fields):
    return _start(furniture=(_with(FURNITURE[0], **fields),))


def test_what_fits_its_scene_is_a_start():
    check_start(EpisodeStart(GOALS, PLACED, FURNITURE, {"goal": np.eye(4)}), 1, PARTS, ("goal",))
    check_start(EpisodeStart((OpenGoal("drawer"),), furniture=FURNITURE), 0, PARTS)


@pytest.mark.parametrize(
    ("start", "said"),
    [
        (_start(()), "no goal"),
        (_start((PoseGoal("objekt", np.eye(4)),)), "goal 0 .* 'objekt'; .* object"),
        (_start(objects=_object(np.eye(4), 5)), "index 5; the scene has 1"),
        (_start(objects=_object(np.eye(4), 0.0)), "index of object 'object' is 0.0"),
        (_start(objects=_object(np.full((4, 4), np.nan))), "object 'object' has NaN"),
        (_start(objects=_object(np.diag([2.0, 1, 1, 1]))), "object 'object' is no rigid"),
        (_start(objects=_object(np.diag([-1.0, 1, 1, 1]))), "object 'object' is no rigid"),
        (_start(objects=_object(np.zeros((4, 4)))), "object 'object' is no rigid"),
        (_start(objects=_object(None)), r"shape \(\); expected a pose"),
        (_start(objects=PLACED | {"other": PLACED["object"]}), "object 0 of the scene is twice"),
        (_start(objects={"mug": PLACED["object"]}), "'mug' .* observed_objects: object, other"),
        (_start(objects=[PLACED["object"]]), "objects of the start .* a mapping"),
        (_start(objects={"object": np.eye(4)}), "expected a PlacedObject"),
        (_start((_with(GOALS[0], pose=np.full((4, 4), np.nan)),)), "pose of goal 0 .* finite"),
        (_start((OrientationGoal("object", np.zeros((3, 3))),)), "rotation of goal 0 .* rigid"),
        (_start((*GOALS, "lift")), "goal 1 of the start is 'lift'; expected a Goal"),
        (_start(GOALS[0]), "goals of the start is PoseGoal.* expected a tuple"),
        (_start((OpenGoal("drawer"),)), "about the part 'drawer'; those in play are none"),
        (_start((InsideGoal("object", "door"),), furniture=FURNITURE), "'door'; .* are drawer"),
        (_start(fixtures={"gaol": np.eye(4)}), "unknown fixture of the start 'gaol'; .* goal"),
        (_start(fixtures={"goal": np.zeros((4, 4))}), "fixture 'goal' is no rigid"),
        (_furniture(index=1), "index 1"),
        (_furniture(position=np.full(3, np.inf)), "position of furniture 0 .* finite"),
        (_furniture(quaternion=2 * np.eye(4)[0]), "quaternion of furniture 0 .* length 1"),
        (_furniture(openings={"door": 0.1}), "unknown part of furniture 0 'door'"),
        (_start(furniture=FURNITURE * 2), "furniture 0 of the scene is twice"),
        (None, "the start is None; expected an EpisodeStart"),
    ],
)
def test_what_does_not_fit_is_one_line(start, said):
    with pytest.raises(InputError, match=said) as caught:
        check_start(start, 1, PARTS, ("goal",), ("object", "other"))
    assert "\n" not in str(caught.value)


class _Bare(ManipulationTask):
    """Whose constructor forgets the one of its base."""

    def __init__(self):
        pass

    def sample(self, rng, spec, preview):
        raise NotImplementedError


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda env_config: 5, "factory of own/task returned 5; expected a ManipulationTask"),
        (lambda env_config: _Bare(), r"own/task has no scene; expected super.* in _Bare.__init__"),
    ],
)
def test_a_factory_that_makes_no_task_is_one_line(made, said):
    scenes = SceneSource(TaskSpec("own", "task", made, (), "Own."), EnvConfig("own/task"))
    with pytest.raises(InputError, match=said):
        scenes.build(None)


def test_nobody_writes_to_the_start_of_an_episode():
    environment = load("single_object", "target_pose", seed=0, obs_mode="state")
    environment.reset()
    start = environment.task.start
    goal, marker = start.goals[0].pose, start.fixtures["goal"]
    assert not np.shares_memory(goal, marker)
    for array in (goal, marker, start.objects["object"].pose):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 3] = 9.0
    for other in (pickle.loads(pickle.dumps(start)), copy.deepcopy(start)):
        np.testing.assert_array_equal(other.goals[0].pose, goal)


def test_a_start_is_apart_from_the_arrays_it_was_drawn_with():
    goal, pose, position = np.eye(4), np.eye(4), np.zeros(3)
    piece = PlacedFurniture(0, position, np.eye(4)[0])
    drawn = EpisodeStart(
        (PoseGoal("object", goal), OpenGoal("drawer")), {"object": PlacedObject(0, pose)}, (piece,)
    )
    start = read_only(drawn)
    for array in (goal, pose, position):
        array += 1.0
    np.testing.assert_array_equal(start.goals[0].pose, np.eye(4))
    np.testing.assert_array_equal(start.objects["object"].pose, np.eye(4))
    np.testing.assert_array_equal(start.furniture[0].position, np.zeros(3))
    assert start.goals[1] == OpenGoal("drawer") and drawn.goals[0].pose.flags.writeable
