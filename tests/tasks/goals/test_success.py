"""Success is one function of arrays: every condition counts, in NumPy and in JAX."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from manipose_mj.poses import SymmetryGroup, compose, rotation_about
from manipose_mj.tasks.goals import (
    InsideGoal,
    OnTableGoal,
    OpenGoal,
    OrientationGoal,
    ShutGoal,
    success,
)
from manipose_mj.tasks.goals.conditions import Tolerance, inside_cavity, pose_goal_met
from manipose_mj.tasks.scene.state import ObjectState, PartState, SceneState

X, Y, Z = np.eye(3)
TOLERANCE = Tolerance()


@pytest.fixture(params=["numpy", "jax"])
def asarray(request):
    if request.param == "numpy":
        return np.asarray
    return pytest.importorskip("jax").numpy.asarray


def _pose(turn=0.0, axis=Z, shift=(0.0, 0.0, 0.0)) -> np.ndarray:
    return compose(rotation_about(axis, turn), np.array(shift))


GOAL = _pose(1.1, Y, (0.4, -0.2, 0.1))
AT_GOAL = {"label_pose": GOAL, "linear_speed": 0.0, "angular_speed": 0.0, "touched": False}
# What changes, and whether the goal is met still, for a shape without symmetry.
POSE_CASES = [
    ({}, True),
    ({"label_pose": _pose(shift=(0.019, 0, 0)) @ GOAL}, True),
    ({"label_pose": _pose(shift=(0.021, 0, 0)) @ GOAL}, False),
    ({"label_pose": _pose(shift=(0, 0, -0.021)) @ GOAL}, False),
    ({"label_pose": GOAL @ _pose(radians(14), X)}, True),
    ({"label_pose": GOAL @ _pose(radians(16), X)}, False),
    ({"linear_speed": 0.009, "angular_speed": 0.09}, True),
    ({"linear_speed": 0.011}, False),
    ({"angular_speed": 0.11}, False),
    ({"touched": True}, False),
]


@pytest.mark.parametrize(("changes", "met"), POSE_CASES)
def test_a_pose_goal_needs_every_condition(asarray, changes, met):
    case = {name: asarray(value) for name, value in {**AT_GOAL, **changes}.items()}
    answer = pose_goal_met(
        goal_pose=asarray(GOAL), symmetry=SymmetryGroup.identity(), tolerance=TOLERANCE, **case
    )
    assert bool(answer) is met


def test_pose_goals_are_met_up_to_the_symmetry_only(asarray):
    turned = asarray(GOAL @ _pose(radians(90), X))
    rest = (asarray(0.0), asarray(0.0), asarray(False))
    for group, met in ((SymmetryGroup.about_x(), True), (SymmetryGroup.three_planes(), False)):
        assert bool(pose_goal_met(turned, asarray(GOAL), *rest, group, TOLERANCE)) is met


def test_many_worlds_at_once_answer_as_one_does(asarray):
    cases = [{**AT_GOAL, **changes} for changes, _ in POSE_CASES]
    batch = {name: asarray(np.stack([case[name] for case in cases])) for name in AT_GOAL}
    answer = pose_goal_met(
        goal_pose=asarray(GOAL), symmetry=SymmetryGroup.identity(), tolerance=TOLERANCE, **batch
    )
    assert np.asarray(answer).tolist() == [met for _, met in POSE_CASES]


CAVITY = np.array([0.30, 0.20, 0.10])
CAN = np.array([0.25, 0.08, 0.08])  # its label's X is the long axis
SLACK = 0.002


@pytest.mark.parametrize(
    ("pose", "inside"),
    [
        (_pose(), True),
        (_pose(shift=(0.026, 0, 0)), True),  # sticks out by less than the slack
        (_pose(shift=(0.029, 0, 0)), False),
        (_pose(shift=(0, 0.0615, 0)), True),
        (_pose(shift=(0, -0.063, 0)), False),
        (_pose(shift=(0, 0, 0.0115)), True),
        (_pose(shift=(0, 0, 0.013)), False),
        (_pose(radians(90), Z), False),  # 25 cm across 20 cm
        (_pose(radians(90), Y), False),  # upright in 10 cm
        (_pose(radians(45), X), True),  # rolled: a cylinder, whatever its roll
    ],
)
def test_a_can_is_inside_where_all_of_its_cylinder_is(asarray, pose, inside):
    assert bool(inside_cavity(asarray(pose), CAN, True, CAVITY, SLACK)) is inside


def test_a_rolled_box_needs_the_room_of_its_corners(asarray):
    rolled = asarray(_pose(radians(45), X))
    assert not bool(inside_cavity(rolled, CAN, False, CAVITY, SLACK))
    assert bool(inside_cavity(asarray(_pose()), CAN, False, CAVITY, SLACK))


def test_the_reach_of_a_tilted_cylinder_is_that_of_its_surface():
    tilt = radians(20)
    extents = np.array([0.10, 0.06, 0.06])
    angles = np.linspace(0, 2 * np.pi, 721)
    rim = np.stack([np.full_like(angles, 0.05), 0.03 * np.cos(angles), 0.03 * np.sin(angles)], 1)
    points = np.concatenate([rim, rim * [-1, 1, 1]]) @ _pose(tilt, Y)[:3, :3].T
    exact = 2 * np.abs(points).max(axis=0)
    assert inside_cavity(_pose(tilt, Y), extents, True, exact + 1e-5, 0.0)
    for axis in range(3):
        less = exact - 1e-3 * np.eye(3)[axis]
        assert not inside_cavity(_pose(tilt, Y), extents, True, less, 0.0)


DRAWER_RANGE = np.array([0.1, 0.3])
STORED = {
    "label_pose": _pose(),
    "opening": 0.105,
    "linear_speed": 0.0,
    "angular_speed": 0.0,
    "touched": False,
}


def _state(asarray, **case) -> SceneState:
    case = {name: asarray(value) for name, value in {**STORED, **case}.items()}
    no, here = asarray(False), asarray(_pose())
    opening, yes = case.pop("opening"), asarray(True)
    can = ObjectState(CAN, SymmetryGroup.about_x(), held=no, **case)
    part = PartState(DRAWER_RANGE, CAVITY, yes, opening, here, here, no)
    return SceneState(here, asarray(0.0), {"can": can}, {"drawer": part})


@pytest.mark.parametrize(
    ("changes", "met"),
    [
        ({}, True),
        ({"opening": 0.1095}, True),
        ({"opening": 0.1105}, False),
        ({"opening": 0.0995}, True),  # pressed into its stop
        ({"label_pose": _pose(shift=(0.0, 0.0, 0.5))}, False),
        ({"linear_speed": 0.02}, False),
        ({"angular_speed": 0.2}, False),
        ({"touched": True}, False),
    ],
)
def test_storing_needs_every_condition(asarray, changes, met):
    goals = (InsideGoal("can", "drawer"), ShutGoal("drawer"))
    assert bool(success(goals, _state(asarray, **changes), TOLERANCE)) is met


@pytest.mark.parametrize(("beyond", "met"), [(0.0, True), (0.08, False)])
def test_a_tool_is_inside_by_its_box_and_not_by_its_origin(asarray, beyond, met):
    """A screwdriver's origin is nearer to one end: its box, not its origin, has to lie in the middle."""
    center = np.array([0.06, 0.0, 0.0])
    tool = {"extents": np.array([0.2, 0.03, 0.03]), "center": center}
    state = _state(asarray, label_pose=_pose(shift=beyond * X - center))
    lying = replace(state.objects["can"], **{k: asarray(v) for k, v in tool.items()})
    state = replace(state, objects={"can": lying})
    assert bool(success((InsideGoal("can", "drawer"),), state, TOLERANCE)) is met


@pytest.mark.parametrize(
    ("goal", "changes", "met"),
    [
        (OpenGoal("drawer"), {"opening": 0.281}, True),
        (OpenGoal("drawer"), {"opening": 0.279}, False),
        (ShutGoal("drawer", 0.9), {"opening": 0.119}, True),
        (ShutGoal("drawer", 0.9), {"opening": 0.121}, False),
        (OnTableGoal("can"), {"label_pose": _pose(shift=(0.0, 0.0, 0.05))}, True),
        (OnTableGoal("can"), {"label_pose": _pose(shift=(0.0, 0.0, -0.7))}, False),
        (OrientationGoal("can", _pose(0.2, Y)[:3, :3]), {}, False),
        (OrientationGoal("can", _pose(0.2, Y)[:3, :3]), {"label_pose": _pose(0.4, Y, (1, 1, 0.1))}, True),
        (OrientationGoal("can", _pose(0.2, Y)[:3, :3]), {"label_pose": _pose(0.5, Y, (1, 1, 0.1))}, False),
        (OrientationGoal("can", _pose(2.0, X)[:3, :3]), {"label_pose": _pose(shift=(0.0, 0.0, 0.1))}, True),
        (OrientationGoal("can", np.eye(3)), {"label_pose": _pose(shift=(0, 0, 0.1)), "touched": True}, False),
    ],
)  # fmt: skip
def test_single_conditions(asarray, goal, changes, met):
    assert bool(goal.met(_state(asarray, **changes), TOLERANCE)) is met


def test_states_may_be_batches(asarray):
    poses = np.stack([_pose(shift=(0.0, 0.0, z)) for z in (0.0, 0.5)])
    flags = {
        "linear_speed": np.zeros(2),
        "angular_speed": np.zeros(2),
        "touched": np.zeros(2, bool),
    }
    state = _state(asarray, label_pose=poses, opening=np.full(2, 0.1), **flags)
    goals = (InsideGoal("can", "drawer"), ShutGoal("drawer"))
    assert np.asarray(success(goals, state, TOLERANCE)).tolist() == [True, False]
