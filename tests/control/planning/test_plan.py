"""Plans are data that survives JSON, is refused when malformed, and opens a drawer only if shut."""

from __future__ import annotations

import json
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from manipose_mj.assets.asset import Cavity, GraspSet
from manipose_mj.assets.geometry import Joint
from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.planning import planner
from manipose_mj.control.planning.cavity_places import poses_in_cavity
from manipose_mj.control.planning.plan import Step, plan_from_json, plan_schema, plan_to_json
from manipose_mj.control.planning.planner import make_plan
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate, SceneEstimate
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, compose, invert, rotation_about
from manipose_mj.tasks.goals import Goal, InsideGoal, OnTableGoal, PoseGoal, ShutGoal
from manipose_mj.tasks.goals.conditions import inside_cavity

Z = np.array([0.0, 0.0, 1.0])
POSE = compose(rotation_about(np.array([0.6, 0.0, 0.8]), 1.2), np.array([0.4, -0.1, 0.2]))
BASE = compose(rotation_about(Z, 0.1), np.array([0.9, 0.1, 0.0]))
SUBJECTS = {"object", "drawer"}
NO_GEOMS = np.zeros(1, bool)
NO_SCENE = Mock(spec=PlanningScene)  # without a motion planner nothing looks at it


def _object(extents=(0.25, 0.075, 0.075)) -> ObjectEstimate:
    label = PoseLabel(np.zeros(3), np.eye(3), "axial", np.array(extents), SymmetryGroup.about_x())
    grasps = GraspSet(np.empty((0, 4, 4)), np.empty(0), np.empty((0, 1), bool))
    return ObjectEstimate("object", POSE, label, lambda: grasps, 1, NO_GEOMS)


def _drawer(opening: float = 0.0) -> PartEstimate:
    handle = PoseLabel(
        np.array([-0.2, 0.0, 0.3]), np.stack([[0, 1.0, 0], [-1.0, 0, 0], [0, 0, 1.0]], axis=1),
        "handle", np.array([0.1, 0.03, 0.01]), SymmetryGroup.identity(),
    )  # fmt: skip
    cavity = Cavity(np.array([0.0, 0.0, 0.3]), np.array([0.28, 0.30, 0.12]), moves_with_part=True)
    joint = Joint("slide", np.zeros(3), np.array([-1.0, 0.0, 0.0]), (0.0, 0.2))
    moved = BASE @ compose(np.eye(3), joint.axis * opening)
    return PartEstimate(
        "drawer", BASE, moved, opening, joint, handle, cavity, body=2, geoms=NO_GEOMS
    )


def _estimate(opening: float = 0.0, obj: ObjectEstimate | None = None) -> SceneEstimate:
    return SceneEstimate(
        np.zeros(7), 0.08, {"object": obj or _object()}, {"drawer": _drawer(opening)}, NO_SCENE
    )


PLAN = (
    Step("grasp_at", "drawer"),
    Step("move_to", "drawer", opening=0.19),
    Step("release", "drawer"),
    Step("grasp_at", "object"),
    Step("move_to", "object", poses=(POSE, np.eye(4))),
    Step("release", "object"),
)


def test_a_plan_survives_json():
    back = plan_from_json(plan_to_json(PLAN), SUBJECTS)
    assert [str(step) for step in back] == [str(step) for step in PLAN]
    for own, read in zip(PLAN, back, strict=True):
        assert read.opening == own.opening
        assert len(read.poses) == len(own.poses)
        for a, b in zip(own.poses, read.poses, strict=True):
            np.testing.assert_allclose(b, a, atol=3e-6)


def test_an_empty_plan_is_a_plan():
    assert plan_from_json("[]", SUBJECTS) == ()


def _kinds(entry: dict, schema: dict) -> list[dict]:
    """The kinds of step in a schema whose fields are those of an entry."""
    return [
        kind
        for kind in schema["items"]["anyOf"]
        if set(kind["required"]) == set(kind["properties"]) == set(entry)
        and entry["primitive"] in kind["properties"]["primitive"]["enum"]
    ]


def test_the_schema_describes_what_the_writer_writes_and_the_reader_takes():
    schema = plan_schema(SUBJECTS)
    for entry in json.loads(plan_to_json(PLAN)):
        (kind,) = _kinds(entry, schema)
        assert entry["subject"] in kind["properties"]["subject"]["enum"]
        assert not kind["additionalProperties"]
    assert not _kinds({"primitive": "move_to", "subject": "object"}, schema)
    assert not _kinds({"primitive": "release", "subject": "object", "opening": 0.1}, schema)
    assert all("enum" not in k["properties"]["subject"] for k in plan_schema()["items"]["anyOf"])


VECTOR = [0.4, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0]
MOVE = {"primitive": "move_to", "subject": "object"}
MALFORMED = [
    ("{", "JSON"),
    ('{"primitive": "release", "subject": "object"}', "list of steps"),
    (["release object"], r"plan\[0\].*expected an object"),
    ([{"primitive": "release"}], "subject"),
    ([{"primitive": "release", "subject": "cup"}], "'cup'; expected one of drawer, object"),
    ([{"primitive": "release", "subject": ["object"]}], "subject"),
    ([{"primitive": "throw", "subject": "object"}], "'throw'"),
    ([{"primitive": ["release"], "subject": "object"}], "primitive"),
    ([{"primitive": "release", "subject": "object", "force": 3}], "unknown field 'force'"),
    ([{"primitive": "release", "subject": "object"}, {}], r"plan\[1\].*primitive"),
    ([MOVE], "one of 'poses' and 'opening'"),
    ([{**MOVE, "poses": [VECTOR], "opening": 0.1}], "one of 'poses' and 'opening'"),
    ([{"primitive": "grasp_at", "subject": "object", "opening": 0.1}], "the others neither"),
    ([{**MOVE, "poses": []}], "poses"),
    ([{**MOVE, "poses": VECTOR}], "pose"),
    ([{**MOVE, "poses": [VECTOR[:6]]}], "quaternion"),
    ([{**MOVE, "poses": [[0.4, 0, 0.1, 1, 1, 0, 0]]}], "unit quaternion"),
    ([{**MOVE, "poses": [["a", *VECTOR[1:]]]}], "quaternion"),
    ([{**MOVE, "poses": [[float("nan"), *VECTOR[1:]]]}], "quaternion"),
    ([{**MOVE, "poses": [[10**400, *VECTOR[1:]]]}], "quaternion"),
    ([{**MOVE, "opening": "wide"}], "opening"),
    ([{**MOVE, "opening": True}], "opening"),
    ([{**MOVE, "opening": float("nan")}], "opening"),
    ([{**MOVE, "opening": float("inf")}], "opening"),
]  # fmt: skip


@pytest.mark.parametrize(("plan", "message"), MALFORMED)
def test_a_malformed_plan_is_refused_in_one_line(plan, message):
    text = plan if isinstance(plan, str) else json.dumps(plan)
    with pytest.raises(InputError, match=message) as caught:
        plan_from_json(text, SUBJECTS)
    assert "\n" not in str(caught.value) and str(caught.value).startswith("plan")


def _words(plan) -> list[str]:
    return [str(step) for step in plan]


STORE = (InsideGoal("object", "drawer"), ShutGoal("drawer"))
PLACE = ["grasp_at object", "move_to object", "release object"]
OPEN = ["grasp_at drawer", "move_to drawer", "release drawer"]
SHUT = ["move_to drawer"]  # with nothing in the hand: a push


def test_a_pose_goal_is_grasp_move_release():
    plan = make_plan((PoseGoal("object", POSE),), _estimate())
    assert _words(plan) == PLACE
    np.testing.assert_array_equal(plan[1].poses[0], POSE)


@pytest.mark.parametrize("opening", [0.0, 0.1])
def test_a_shut_or_half_open_drawer_is_opened_filled_and_shut(opening):
    plan = make_plan(STORE, _estimate(opening))
    assert _words(plan) == OPEN + PLACE + SHUT
    assert plan[1].opening is not None and 0.17 < plan[1].opening < 0.2  # not into its stop
    assert plan[6].opening == 0.0


def test_an_open_drawer_is_not_opened_again():
    plan = make_plan(STORE, _estimate(0.19))
    assert _words(plan) == PLACE + SHUT


def test_an_object_that_fits_no_way_is_refused():
    with pytest.raises(InputError, match="object fits the cavity of drawer in no orientation"):
        make_plan(STORE, _estimate(obj=_object((0.35, 0.08, 0.08))))
    drawer = replace(_drawer(), cavity=None)
    assert poses_in_cavity(_object(), drawer, 0.1) == ()


class TiltedGoal(Goal):
    """A goal of somebody's own."""

    def met(self, state, tolerance):
        return True

    def progress(self, state, tolerance):
        return 1.0


def test_a_goal_of_a_kind_without_plans_is_refused():
    with pytest.raises(InputError, match="no plan for a TiltedGoal; it plans for PoseGoal, "):
        make_plan((TiltedGoal(),), _estimate())
    kept = (PoseGoal("object", POSE), OnTableGoal("object"))
    assert make_plan(kept, _estimate()) == make_plan(kept[:1], _estimate())


def test_a_goal_that_no_plan_reaches_is_told_by_its_number(monkeypatch):
    monkeypatch.setattr(planner, "part_goal_plans", lambda *arguments: iter(()))
    with pytest.raises(InputError, match="goal 1 of the task has no plan"):
        make_plan((PoseGoal("object", POSE), ShutGoal("drawer")), _estimate())
    monkeypatch.setattr(planner, "candidate_plans", lambda *arguments: iter(()))
    with pytest.raises(InputError, match="the task's goals have no plan"):
        make_plan((PoseGoal("object", POSE),), _estimate())


@pytest.mark.parametrize("extents", [(0.25, 0.075, 0.075), (0.10, 0.06, 0.08), (0.05, 0.05, 0.05)])
def test_poses_in_the_cavity_fit_it_and_stand_on_its_floor(extents):
    obj, drawer, opening = _object(extents), _drawer(), 0.15
    poses = poses_in_cavity(obj, drawer, opening)
    assert poses
    cavity = drawer.cavity
    assert cavity is not None
    carrier = BASE @ compose(np.eye(3), drawer.joint.axis * opening + cavity.center)
    heights = []
    for pose in poses:
        inner = invert(carrier) @ pose
        assert inside_cavity(inner, obj.label.extents, False, cavity.extents, 0.0)
        reach = np.abs(inner[2, :3]) @ obj.label.extents / 2
        gap = inner[2, 3] - reach + cavity.extents[2] / 2
        assert 0 < gap < 0.005
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
        heights.append(reach)
    assert heights == sorted(heights)  # lying first
