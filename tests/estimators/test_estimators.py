"""Anyone's estimator is found, asked, checked, and told from ours where it fails, in process and on a server."""

from __future__ import annotations

import json

import numpy as np
import pytest

import tests.estimators.answers as answers
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError, ServerLostError
from manipose_mj.estimators.answer import EstimatorFailedError, checked_answer
from manipose_mj.estimators.loading import load_estimator
from manipose_mj.estimators.service import EstimatorService
from manipose_mj.estimators.settings import EstimatorSettings, chosen_estimator
from manipose_mj.estimators.view_evaluation import predict_views, view_observation
from manipose_mj.poses import compose, invert, rotation_about, transform
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.data.view_stream import catalogue_views
from manipose_mj.ppf_jax.pose_estimate import PoseEstimate
from tests.wire.answering import answering

HERE = "tests.estimators.answers"
IDENTITY = np.eye(4).tolist()


@pytest.fixture(autouse=True)
def nothing_loaded():
    load_estimator.cache_clear()
    yield
    load_estimator.cache_clear()


@pytest.fixture(scope="module")
def views():
    return list(catalogue_views("mug", 4, view_setting("anywhere"), 2))


def test_an_observation_holds_what_a_camera_sees_and_no_more(views):
    seen = views[0]
    observation = view_observation(seen, seed=3, give_cad=False)
    assert set(observation) == {
        "category", "cloud", "normals", "colours", "depth", "rgb", "mask", "intrinsics", "camera_pose", "seed",
    }  # fmt: skip
    n = len(observation["cloud"])
    assert observation["colours"].shape == observation["normals"].shape == (n, 3)
    image = observation["cloud"].astype(float) @ observation["intrinsics"].T
    u, v = np.round(image[:, :2] / image[:, 2:]).astype(int).T
    assert observation["mask"][v, u].all()
    np.testing.assert_array_equal(observation["rgb"][v, u], observation["colours"])
    np.testing.assert_allclose(observation["depth"][v, u], observation["cloud"][:, 2], atol=1e-5)


def test_the_mesh_that_is_asked_for_lies_on_the_cloud(views):
    mesh = view_observation(views[0], seed=0, give_cad=True)["mesh"]
    assert mesh["vertices"].dtype == np.float32 and mesh["faces"].max() < len(mesh["vertices"])
    cloud = transform(invert(views[0].T_camera_label), views[0].cloud.points.astype(float))
    inside = (cloud > mesh["vertices"].min(axis=0) - 0.01) & (
        cloud < mesh["vertices"].max(axis=0) + 0.01
    )
    assert inside.all(axis=1).mean() > 0.8
    middle = (mesh["vertices"].max(axis=0) + mesh["vertices"].min(axis=0)) / 2
    np.testing.assert_allclose(middle, 0, atol=1e-4)  # a mug's origin is its box's centre


def test_a_factory_gets_its_arguments():
    service = load_estimator(EstimatorSettings(f"{HERE}:Middle", '{"score": 0.7}'))
    found = service.estimate({"cloud": np.ones((5, 3)), "category": "mug"})
    assert found.confidence == 0.7 and found.pose[0, 3] == 1 and np.isnan(found.extents).all()
    assert load_estimator(EstimatorSettings(f"{HERE}:Middle", '{"score": 0.7}')) is service


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("no_such_module:Factory", None, "cannot import no_such_module"),
        (f"{HERE}:Midle", None, "did you mean Middle"),
        (f"{HERE}", None, "expected package.module:Factory"),
        (f"{HERE}:not_callable", None, "cannot be called"),
        (f"{HERE}:without_estimate", None, "the object that it makes has no method estimate"),
        (f"{HERE}:failing", None, "its factory failed (RuntimeError: no GPU)"),
        (f"{HERE}:leaving", None, "its factory failed (SystemExit: 0)"),
        (f"{HERE}:Middle", '{"scor": 1}', "unexpected keyword"),
        (f"{HERE}:Middle", "{", "no JSON"),
        (f"{HERE}:Middle", "[1]", "expected a JSON object"),
        ("ws://127.0.0.1:9", None, "no estimator server answers"),
        ("ws://127.0.0.1:9", "{}", "a server takes no --estimator-args"),
    ],
)
def test_a_bad_estimator_is_one_line_and_exit_2(name, arguments, message, tmp_path, capsys):
    words = ["--estimator", name] + (["--estimator-args", arguments] if arguments else [])
    out = tmp_path / "out"
    task = "single_object/target_pose"
    for command in (
        ["pose", "evaluate", "mug", "--views", "1"],
        ["evaluate", task, "--objects", "mug_000", "--pose", "estimated", "--out", str(out)],
    ):
        assert main([*command, *words]) == 2
        said = capsys.readouterr().err
        assert message in said and said.count("\n") == 1, said
    assert not (out / "results.jsonl").exists() and not (out / "run.json").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["evaluate", "single_object/target_pose", "--estimator", "a:b"], "needs --pose estimated"),
        (["evaluate", "single_object/target_pose", "--give-cad"], "--give-cad is for an estimator"),
        (
            ["pose", "evaluate", "mug", "--estimator-args", "{}"],
            "--estimator-args is for an estimator",
        ),
        (["pose", "evaluate", "mug", "--estimator", "a:b", "--weights", "w.npz"], "leave them out"),
    ],
)
def test_options_that_do_not_go_together(words, message, capsys):
    assert main(words) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (None, "answered a NoneType"),
        ({"score": 1}, "answer has no 'pose'"),
        ({"pose": IDENTITY}, "answer has no 'score'"),
        ({"pose": np.eye(3), "score": 1}, r"pose has shape \(3, 3\); expected \(4, 4\)"),
        ({"pose": np.full((4, 4), np.nan), "score": 1}, "pose is not finite"),
        ({"pose": np.diag([1.0, 1.0, -1.0, 1.0]), "score": 1}, "not a rigid transform"),
        ({"pose": 2 * np.eye(4), "score": 1}, "not a rigid transform"),
        ({"pose": "here", "score": 1}, "pose is not made of numbers"),
        ({"pose": np.eye(4) * (1 + 0j), "score": 1}, "pose is not made of numbers"),
        ({"pose": IDENTITY, "score": 2}, r"score is 2\.0; expected 0 to 1"),
        ({"pose": IDENTITY, "score": 1.00001}, r"score is 1\.00001; expected 0 to 1"),
        ({"pose": IDENTITY, "score": np.nan}, "score is not finite"),
        ({"pose": IDENTITY, "score": 1, "extents": [1, 0, 1]}, "extents are not positive"),
        ({"pose": IDENTITY, "score": 1, "hypotheses": 3}, "hypotheses are a int"),
        ({"pose": IDENTITY, "score": 1, "hypotheses": [{}]}, "hypothesis 0: answer has no 'pose'"),
        (
            {"pose": IDENTITY, "score": 1, "hypotheses": [IDENTITY]},
            "hypothesis 0 is a list; expected a dictionary",
        ),
    ],
)
def test_what_is_no_answer_is_said(answer, message):
    with pytest.raises(EstimatorFailedError, match=f"estimator mine: .*{message}"):
        EstimatorService("mine", answers.Says(answer)).estimate({})


@pytest.mark.usefixtures("wrong_arrays")
def test_scores_may_be_rounded_and_extents_unknown():
    assert checked_answer({"pose": IDENTITY, "score": np.float32(1) + 1e-7}).confidence == 1.0
    assert checked_answer({"pose": IDENTITY, "score": -1e-9}).confidence == 0.0
    assert np.isnan(checked_answer(PoseEstimate(np.eye(4), None, 0.5)).extents).all()
    with pytest.raises(EstimatorFailedError, match="extents is not made of numbers"):
        checked_answer(PoseEstimate(np.eye(4), "long", 0.5))


def test_answers_keep_hypotheses_and_extents():
    other = compose(rotation_about(np.array([1.0, 0, 0]), 0.3), np.array([0, 0, 1.0]))
    more = [{"pose": other, "score": 0.1, "extents": [1, 2, 3]}]
    found = checked_answer({"pose": IDENTITY, "score": 0.6, "hypotheses": more})
    assert found.confidence == 0.6 and len(found.hypotheses) == 1
    np.testing.assert_array_equal(found.hypotheses[0].extents, [1, 2, 3])
    mesh = {"vertices": np.array([[0, 0, 0], [0.1, 0.2, 0.3]], np.float32)}
    known = checked_answer({"pose": IDENTITY, "score": 0.6}, mesh)
    np.testing.assert_allclose(known.extents, [0.1, 0.2, 0.3])


def test_an_error_of_the_estimator_names_it_in_one_line():
    with pytest.raises(EstimatorFailedError, match="estimator mine raised KeyError: ") as raised:
        EstimatorService("mine", answers.Raises()).estimate({})
    assert "\n" not in str(raised.value)
    with pytest.raises(EstimatorFailedError, match="estimator mine raised SystemExit: 3"):
        EstimatorService("mine", answers.Leaves()).estimate({})


class _Tensor:
    """As PyTorch's of which a gradient is wanted."""

    def __array__(self, *_, **__):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad.")


def test_an_answer_that_cannot_be_read_is_the_estimators():
    told = PoseEstimate(np.eye(4), np.full(3, 0.1), 0.5)
    object.__setattr__(told, "extents", _Tensor())
    for answer, name in (({"pose": _Tensor(), "score": 1}, "pose"), (told, "extents")):
        with pytest.raises(EstimatorFailedError, match=f"mine: {name} is no array: RuntimeError"):
            EstimatorService("mine", answers.Says(answer)).estimate({})


def test_a_mistake_of_ours_is_not_the_estimators():
    empty = {"vertices": np.zeros((0, 3), np.float32), "faces": np.zeros((0, 3), np.int32)}
    with pytest.raises(ValueError, match="zero-size array"):
        EstimatorService("mine", answers.Says({"pose": IDENTITY, "score": 1})).estimate(
            {"mesh": empty}
        )


def test_a_server_answers_as_the_same_estimator_in_process_does(views):
    here = EstimatorService("here", answers.Middle(0.4))
    served = answers.Middle(0.4)
    with answering(served.estimate) as address:
        there = load_estimator(EstimatorSettings(address))
        for number, seen in enumerate(views):
            observation = view_observation(seen, seed=number, give_cad=True)
            one, other = here.estimate(observation), there.estimate(observation)
            np.testing.assert_array_equal(one.pose, other.pose)
            assert one.confidence == other.confidence
            for key, value in observation.items():
                got = served.seen[number][key]
                if key == "mesh":
                    np.testing.assert_array_equal(got["faces"], value["faces"])
                elif isinstance(value, np.ndarray):
                    np.testing.assert_array_equal(got, value)
                else:
                    assert got == value


def test_a_server_that_fails_on_one_object_is_asked_again():
    count = 0

    def answer(observation):
        nonlocal count
        count += 1
        if count == 1:
            raise ValueError("too dark")
        return {"pose": np.eye(4), "score": 0.5}

    with answering(answer) as address:
        service = load_estimator(EstimatorSettings(address))
        with pytest.raises(EstimatorFailedError, match="the server failed: ValueError: too dark"):
            service.estimate({})
        assert service.estimate({}).confidence == 0.5
        service.close()
        assert service.estimate({}).confidence == 0.5  # connects again
    with pytest.raises(ServerLostError):
        service.estimate({})


def test_poses_of_views_are_in_their_order_and_timed(views):
    told = []
    clouds, found = predict_views(
        EstimatorService("a", answers.Middle()), views, give_cad=False, progress=told.append
    )
    assert told == [cloud.name for cloud in clouds] == [seen.cloud.name for seen in views]
    np.testing.assert_allclose(
        found.poses[1, :3, 3], np.median(clouds[1].points, axis=0), atol=1e-6
    )
    assert found.ms_per_object > 0 and list(found.confidence) == [0.2, 0.2]
    with pytest.raises(InputError, match=r"mug_004/0: estimator a raised KeyError"):
        predict_views(EstimatorService("a", answers.Raises()), views, give_cad=False)


def test_pose_evaluate_runs_it(monkeypatch, capsys):
    monkeypatch.setattr("manipose_mj.cli.pose.foreign_views.split_indices", lambda *_: [4])
    words = ["pose", "evaluate", "mug", "--estimator", f"{HERE}:Middle", "--views", "2"]
    assert main([*words, "--give-cad", "--json"]) == 0
    printed = capsys.readouterr()
    (row,) = json.loads(printed.out)
    assert printed.err.count("the middle of") == 2
    assert row["n"] == 2 and row["method"] == f"{HERE}:Middle" and row["given_cad"]
    assert row["origin_cm_mean"] < 10 and row["trained_on"] is None
    assert main([*words, "--give-cad"]) == 0
    shown = capsys.readouterr().out
    assert "unseen" not in shown and "given CAD" in shown


def test_settings_are_part_of_what_results_belong_to():
    settings = chosen_estimator("a.b:C", '{"k": 1}', True)
    assert settings is not None
    assert settings.identity == {"name": "a.b:C", "arguments": {"k": 1}, "given CAD": True}
    assert settings.words == ["--estimator", "a.b:C", "--estimator-args", '{"k": 1}', "--give-cad"]
    assert chosen_estimator(None, None, False) is None


@pytest.mark.parametrize(
    ("pose", "confidence", "said"),
    [
        (np.full((4, 4), np.nan), 0.5, "pose"),
        (np.eye(4), np.nan, "score"),
        (np.eye(4), 2.0, "score is 2"),
    ],
)
def test_an_answer_of_our_own_class_is_checked_as_well(pose, confidence, said):
    with pytest.raises(EstimatorFailedError, match=said):
        checked_answer(PoseEstimate(pose, np.full(3, 0.1), confidence))


def test_a_right_answer_of_our_own_class_stays_as_it_is():
    other = PoseEstimate(
        compose(rotation_about(np.eye(3)[2], 1.0), np.ones(3)), np.full(3, 0.1), 0.2
    )
    found = checked_answer(PoseEstimate(np.eye(4), np.full(3, np.nan), 0.5, (other,)))
    np.testing.assert_array_equal(found.pose, np.eye(4))
    assert np.isnan(found.extents).all() and found.confidence == 0.5
    np.testing.assert_allclose(found.hypotheses[0].pose, other.pose)


def test_an_estimator_that_changes_what_it_is_given_changes_nothing_else(views):
    class Millimetres:
        def estimate(self, observation):
            for values in (observation["cloud"], observation["mesh"]["vertices"]):
                values *= 1000
            return {"pose": np.eye(4), "score": 0.5}

    seen = views[0]
    before = np.array(seen.cloud.points)
    observation = view_observation(seen, seed=0, give_cad=True)
    lengths = np.ptp(observation["mesh"]["vertices"], axis=0)
    found = EstimatorService("a", Millimetres()).estimate(observation)
    np.testing.assert_allclose(found.extents, lengths, rtol=1e-5)
    np.testing.assert_array_equal(seen.cloud.points, before)
    again = view_observation(seen, seed=0, give_cad=True)
    np.testing.assert_allclose(np.ptp(again["mesh"]["vertices"], axis=0), lengths)
