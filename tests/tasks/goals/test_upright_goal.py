"""The upright goal is a function of arrays, for NumPy and JAX, for one world and many."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.goals import UprightGoal
from manipose_mj.tasks.goals.conditions import Tolerance
from manipose_mj.tasks.scene.state import ObjectState, SceneState

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def mug() -> Asset:
    return catalogue.load("mug", 0)


@pytest.fixture(params=["numpy", "jax"])
def asarray(request):
    if request.param == "numpy":
        return np.asarray
    return pytest.importorskip("jax").numpy.asarray


def _mug_state(mug: Asset, asarray, tilt: float, yaw: float, **changes) -> SceneState:
    upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    turn = rotation_about(UP, yaw) @ rotation_about(np.array([0.6, 0.8, 0.0]), tilt)
    values = {
        "label_pose": compose(turn @ upright, np.array([0.4, 0.1, 0.05])),
        "linear_speed": 0.0, "angular_speed": 0.0, "touched": False, "held": False, **changes,
    }  # fmt: skip
    values["extents"] = mug.label.extents
    state = ObjectState(symmetry=mug.label.symmetry, **{k: asarray(v) for k, v in values.items()})
    return SceneState(asarray(np.eye(4)), asarray(0.08), {"object": state})


@pytest.mark.parametrize(
    ("tilt", "changes", "met"),
    [
        (0.0, {}, True),
        (14.0, {}, True),
        (16.0, {}, False),
        (90.0, {}, False),
        (180.0, {}, False),
        (0.0, {"touched": True}, False),
        (0.0, {"linear_speed": 0.011}, False),
        (0.0, {"angular_speed": 0.11}, False),
        (0.0, {"label_pose": compose(np.eye(3)[[1, 2, 0]], np.array([0.4, 0.0, -0.7]))}, False),
    ],
)
def test_upright_is_within_15_degrees_of_the_vertical_at_rest_and_released(
    mug, asarray, tilt, changes, met
):
    goal, tolerance = UprightGoal("object"), Tolerance()
    for yaw in (0.0, 1.0, 3.0):
        state = _mug_state(mug, asarray, radians(tilt), yaw, **changes)
        assert bool(goal.met(state, tolerance)) == met
        if not changes:
            assert float(goal.error(state)) == pytest.approx(radians(tilt), abs=2e-3)
            assert (float(goal.progress(state, tolerance)) > 0.8) == met


def test_upright_holds_for_many_worlds_at_once(mug):
    poses = np.stack(
        [
            np.asarray(_mug_state(mug, np.asarray, t, 0.3).objects["object"].label_pose)
            for t in (0.0, 1.0)
        ]
    )
    none = np.zeros(2)
    state = _mug_state(
        mug, np.asarray, 0.0, 0.0, label_pose=poses, linear_speed=none, angular_speed=none,
        touched=none.astype(bool), held=none.astype(bool),
    )  # fmt: skip
    assert UprightGoal("object").met(state, Tolerance()).tolist() == [True, False]
