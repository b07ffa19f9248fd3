"""Somebody's estimator is asked what the cameras see, and its answers are what the baseline acts on."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.control.perception.estimated import EstimatedPerception
from manipose_mj.control.perception.foreign_estimator import ForeignEstimator
from manipose_mj.control.perception.objects.known_shapes import known_shapes
from manipose_mj.control.perception.pose_sources import make_perception, sensors_for
from manipose_mj.errors import ServerLostError
from manipose_mj.estimators.loading import load_estimator
from manipose_mj.estimators.observation import asset_mesh
from manipose_mj.estimators.service import EstimatorService
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.failures import StageFailure
from manipose_mj.poses import invert, transform
from manipose_mj.tasks.core.config import EnvConfig

CUP = "cup_004"  # a test object


class Recalled:
    """Answers with the pose that it was told, whatever it sees, and keeps what it saw."""

    def __init__(self, T_world_label, answer=None) -> None:
        self.T_world_label, self.answer = T_world_label, answer
        self.seen: list[dict] = []

    def estimate(self, observation):
        self.seen.append(observation)
        if self.answer is not None:
            return self.answer()
        return {"pose": invert(observation["camera_pose"]) @ self.T_world_label, "score": 0.95}


@pytest.fixture(scope="module")
def cup():
    config = EnvConfig(
        "single_object/target_pose",
        obs_mode="state",
        objects=(CUP,),
        sensors=sensors_for("estimated"),
    )
    environment = suite.make(config, 0)
    environment.reset()
    return environment


@pytest.fixture
def truth(cup):
    return cup.task.object.label_pose(cup.physics)


def perceived(cup, estimator, **options) -> EstimatedPerception:
    service = EstimatorService("mine", estimator)
    return EstimatedPerception(
        cup.task,
        cup.physics,
        estimators=lambda kind: ForeignEstimator(service, kind.category),
        **options,
    )


@pytest.mark.full
def test_its_pose_is_the_scenes_and_a_known_object_stands_in_for_the_shape(cup, truth):
    estimator = Recalled(truth)
    perception = perceived(cup, estimator)
    perception.reset(0)
    found = perception.observe().objects["object"]
    np.testing.assert_allclose(found.label_pose, truth, atol=1e-9)
    lengths = [shape.extents for shape in known_shapes("cup")]
    assert any(np.array_equal(found.label.extents, each) for each in lengths)
    cameras = {each["camera_pose"].tobytes() for each in estimator.seen}
    assert len(cameras) == len(estimator.seen) > 1  # each camera by itself


def test_observations_are_of_the_object_alone_and_without_its_mesh(cup, truth):
    estimator = Recalled(truth)
    perceived(cup, estimator).reset(0)
    observation = estimator.seen[0]
    assert "mesh" not in observation and observation["category"] == "cup"
    assert observation["rgb"].shape == (240, 320, 3) and observation["mask"].shape == (240, 320)
    cloud = transform(observation["camera_pose"], observation["cloud"].astype(float))
    assert np.linalg.norm(cloud - truth[:3, 3], axis=1).max() < 0.15
    assert observation["colours"].max() > 30
    again = Recalled(truth)
    perceived(cup, again).reset(0)
    assert [each["seed"] for each in again.seen] == [each["seed"] for each in estimator.seen]
    assert len({each["seed"] for each in again.seen}) == len(again.seen)


def test_the_mesh_goes_to_the_estimator_where_it_is_asked_for(cup, truth):
    estimator = Recalled(truth)
    perceived(cup, estimator, meshes=asset_mesh).reset(0)
    mesh, asset = estimator.seen[0]["mesh"], cup.task.object.asset
    np.testing.assert_allclose(
        np.ptp(mesh["vertices"], axis=0), asset.label.extents, rtol=0.02, atol=1e-3
    )


@pytest.mark.parametrize(
    ("answer", "reason"),
    [(lambda: {"score": 1}, "answer has no 'pose'"), (lambda: 1 / 0, "raised ZeroDivisionError")],
)
def test_an_estimator_that_fails_is_a_failure_of_perception(cup, truth, answer, reason):
    with pytest.raises(StageFailure, match=reason) as raised:
        perceived(cup, Recalled(truth, answer)).reset(0)
    assert raised.value.stage == "perception"


def _beyond(away: float, extents: float | None = None, among: bool = False):
    """An answer that far from the cameras, or of an object that large; as the first, or as another hypothesis."""
    wrong = {"pose": np.eye(4), "score": 0.9}
    wrong["pose"][0, 3] = away
    if extents is not None:
        wrong["extents"] = np.full(3, extents)
    return {"pose": np.eye(4), "score": 0.9, "hypotheses": [wrong]} if among else wrong


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (_beyond(1e9), "estimator mine: the pose is 1e.09 m from the object's points; expected"),
        (_beyond(0.0, 1e6), "estimator mine: extents are up to 1e.06 m; expected metres"),
        (_beyond(1e9, among=True), "estimator mine: hypothesis 0: the pose is 1e.09 m"),
    ],
    ids=["far", "huge", "hypothesis"],
)
def test_an_answer_that_cannot_be_about_what_is_seen_is_a_failure_of_perception(
    cup, truth, answer, reason
):
    with pytest.raises(StageFailure, match=reason) as raised:
        perceived(cup, Recalled(truth, lambda: answer)).reset(0)
    assert raised.value.stage == "perception"
    assert "\n" not in raised.value.reason


def test_a_wrong_answer_on_the_table_or_of_a_large_object_is_taken(cup, truth):
    answer = _beyond(3.0, 4.0)
    perceived(cup, Recalled(truth, lambda: answer)).reset(0)


def test_a_server_that_is_gone_is_no_failure_of_an_episode(cup, truth):
    def lost():
        raise ServerLostError("gone")

    with pytest.raises(ServerLostError):
        perceived(cup, Recalled(truth, lost)).reset(0)


def test_a_perception_is_made_by_the_estimators_name(cup):
    load_estimator.cache_clear()
    settings = EstimatorSettings("tests.estimators.answers:Middle", '{"score": 1.0}', give_cad=True)
    perception = make_perception("estimated", cup.task, cup.physics, settings)
    perception.reset(0)
    asked = load_estimator(settings).estimator.seen
    assert asked and all("mesh" in each for each in asked)
    load_estimator.cache_clear()
