"""What the estimator does with clouds as they come, with an untrained model: nothing but clear answers."""

from __future__ import annotations

import dataclasses
import importlib
import json
import re
from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np
import pytest

from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, rotation_about
from manipose_mj.ppf_jax import estimator as module
from manipose_mj.ppf_jax.articulated_estimator import ArticulatedEstimator
from manipose_mj.ppf_jax.estimator import PoseEstimator, bucket
from manipose_mj.ppf_jax.points.cloud_input import Cloud
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry
from manipose_mj.ppf_jax.rigid.model import ModelConfig, PoseModel, estimate_sample
from manipose_mj.ppf_jax.rigid.voting import VotingConfig
from manipose_mj.ppf_jax.weight_files import TrainedModel, load_weights, save_weights
from tests.ppf_jax.half_visible import half_visible_clouds

KEY = jax.random.key(0)
CONFIG = ModelConfig(
    voting=VotingConfig(coarse_votes=300, directions=200, axes_kept=2), pairs=501, points=64
)


@pytest.fixture(scope="module")
def trained():
    return TrainedModel(PoseModel(CONFIG, rng=np.random.default_rng(1)), ("mug",))


@pytest.fixture(scope="module")
def mug():
    return half_visible_clouds("mug", [0], 1, points=250)[0]


@pytest.mark.full
def test_one_compilation_for_clouds_of_all_sizes(trained, mug, monkeypatch):
    traced = []

    def whole(model, points, *rest, key):
        traced.append(len(points))
        return estimate_sample(model, points, *rest, key=key)

    monkeypatch.setattr(module, "_estimate_sample", jax.jit(whole))
    estimator = PoseEstimator(trained)
    for count in (40, 130, 250, 99):
        answer = estimator.estimate(mug.points[:count], key=KEY)
        assert answer.pose.shape == (4, 4) and np.isfinite(answer.pose).all()
    assert traced == [CONFIG.points]
    rng = np.random.default_rng(0)
    many = np.tile(mug.points, (6, 1)) + rng.normal(0, 1e-4, (1500, 3)).astype(np.float32)
    assert [bucket(n) for n in (32, 256, 257, 512, 1024)] == [256, 256, 512, 512, 1024]
    estimator.estimate(many, key=KEY)
    estimator.estimate(many[:900], key=KEY)
    assert traced == [CONFIG.points]


def test_clouds_of_more_points_than_are_kept_have_no_padded_size():
    with pytest.raises(InputError, match="cloud of 1025 points; expected at most 1024"):
        bucket(1025)


@pytest.mark.full
def test_one_object_is_estimated_as_by_the_whole_model(trained, mug):
    found = PoseEstimator(trained).estimate(mug, key=KEY)
    room = ((0, 256 - len(mug)), (0, 0))
    points, normals = np.pad(mug.points, room), np.pad(mug.normals, room)
    estimate = jax.jit(lambda *cloud: trained.model.estimate(*cloud, key=KEY))
    whole = estimate(points, normals, np.arange(256) < len(mug))
    np.testing.assert_allclose(found.pose, whole.poses[0], atol=1e-3)
    assert found.confidence == pytest.approx(float(whole.confidence[0]), abs=1e-3)


@pytest.mark.full
def test_the_same_key_gives_the_same_answer_ranked(trained, mug):
    estimator = PoseEstimator(trained)
    first, again = (estimator.estimate(mug, key=KEY) for _ in range(2))
    assert np.array_equal(first.pose, again.pose) and first.confidence == again.confidence
    # 2 X axes with 2 turns each, and the likeliest of what the best may be mistaken for.
    assert len(first.hypotheses) + 1 == 4 + CONFIG.refinement.ambiguous_kept
    assert not first.hypotheses[0].hypotheses
    assert 0 <= first.confidence <= 1 and np.all(first.extents > 0)


def test_other_hypotheses_come_before_what_is_nearly_said_already():
    def upside_down(degrees):
        return compose(
            rotation_about(np.array([0.0, 1.0, 0.0]), np.radians(degrees)), np.array([0, 0, 0.5])
        )

    poses = np.stack([upside_down(d) for d in (0, 4, 181, 10, 90, 178)]).astype(np.float32)
    assert module.distinct_first(poses, CommonSymmetry(axial=True)) == [0, 2, 4, 1, 3, 5]
    spun = compose(rotation_about(np.array([1.0, 0.0, 0.0]), 1.0), np.array([0, 0, 0.5]))
    moved = compose(np.eye(3), np.array([0, 0.03, 0.5]))
    poses = np.stack([upside_down(0), spun, moved]).astype(np.float32)
    assert module.distinct_first(poses, CommonSymmetry(axial=True)) == [0, 2, 1]
    assert module.distinct_first(poses, CommonSymmetry()) == [0, 1, 2]


def test_half_turns_of_a_box_come_after_its_other_poses():
    spun, flipped = (rotation_about(axis, np.pi) for axis in np.eye(3)[:2])
    tilted = rotation_about(np.array([0.0, 0.0, 1.0]), 1.0)
    turns = (np.eye(3), spun, flipped, tilted)
    poses = np.stack([compose(turn, np.array([0, 0, 0.5])) for turn in turns])
    box = CommonSymmetry(unsigned_x=True, unsigned_y=True)
    assert module.distinct_first(poses, box) == [0, 3, 1, 2]
    assert module.distinct_first(poses, CommonSymmetry(unsigned_y=True)) == [0, 2, 3, 1]
    assert module.distinct_first(poses, CommonSymmetry()) == [0, 1, 2, 3]


@pytest.mark.full
def test_stray_points_and_bad_normals_give_no_nan(trained, mug):
    rng = np.random.default_rng(0)
    points, normals = mug.points.copy(), mug.normals.copy()
    stray = rng.random(len(points)) < 0.3
    points[stray] += rng.normal(scale=0.3, size=(stray.sum(), 3))
    normals[stray] = 0.0
    noisy = dataclasses.replace(mug, points=points, normals=normals)
    half = dataclasses.replace(mug, points=mug.points[:40], normals=mug.normals[:40])
    line = np.outer(np.linspace(-0.1, 0.1, 50), [1.0, 0, 0]) + [0, 0, 0.6]
    answers = PoseEstimator(trained).estimate_many([noisy, half, line, mug], key=KEY)
    for answer in answers:
        for each in (answer, *answer.hypotheses):
            assert np.isfinite(each.pose).all() and np.isfinite(each.extents).all()
            assert np.allclose(each.pose[:3, :3] @ each.pose[:3, :3].T, np.eye(3), atol=1e-3)
            assert 0 <= each.confidence <= 1


def _with(points, row, value):
    points = points.copy()
    points[row] = value
    return points


@pytest.mark.parametrize(
    ("corrupt", "words"),
    [
        (lambda p: p[:20], "20 points; expected at least 32"),
        (lambda p: p[:, :2], r"shape \(250, 2\)"),
        (lambda p: p[None], r"shape \(1, 250, 3\)"),
        (lambda p: p.astype(str), "type <U"),
        (lambda p: _with(p, 7, np.nan), "1 of 250 points are not finite"),
        (lambda p: 1000 * p, "millimetres"),
        (lambda p: np.tile(p[:1], (60, 1)), "all points are equal"),
        (lambda p: np.tile(p[:20], (3, 1)), "60 points of which 20 differ; expected at least 32"),
    ],
)
@pytest.mark.usefixtures("wrong_arrays")
def test_a_cloud_that_cannot_be_used_gives_one_line(trained, mug, corrupt, words):
    with pytest.raises(InputError, match=words) as caught:
        PoseEstimator(trained).estimate(corrupt(mug.points), key=KEY)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="cloud 1: "):
        PoseEstimator(trained).estimate_many([mug, corrupt(mug.points)], key=KEY)


@pytest.mark.usefixtures("wrong_arrays")
def test_normals_must_fit_the_points(trained, mug):
    short = dataclasses.replace(mug, normals=mug.normals[:-1])
    with pytest.raises(InputError, match="normals of shape"):
        PoseEstimator(trained).estimate(short, key=KEY)
    words = Cloud(mug.points, mug.points.astype(str))
    with pytest.raises(InputError, match="normals of type <U.*; expected numbers"):
        PoseEstimator(trained).estimate(words, key=KEY)


def test_repeated_points_and_padding_change_no_sample(trained, mug):
    def sample(points, normals=None):
        cloud = points if normals is None else Cloud(points, normals)
        return module.prepared_sample(trained.model, cloud, key=KEY)

    padding = np.zeros((90, 3), np.float32)
    again = np.random.default_rng(0).integers(0, len(mug), 300)
    for extra in (padding, mug.points[again]):
        for one, other in zip(
            sample(mug.points), sample(np.concatenate([mug.points, extra])), strict=True
        ):
            np.testing.assert_array_equal(one, other)
    padded = (np.concatenate([rows, padding]) for rows in (mug.points, mug.normals))
    for one, other in zip(sample(mug.points, mug.normals), sample(*padded), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.usefixtures("wrong_arrays")
def test_what_has_points_and_no_normals_is_points_alone(trained, mug):
    alone = module.prepared_sample(trained.model, mug.points, key=KEY)
    for cloud in (SimpleNamespace(points=mug.points), Cloud(mug.points, 0 * mug.normals)):
        found = module.prepared_sample(trained.model, cloud, key=KEY)  # type: ignore[arg-type]
        for one, other in zip(alone, found, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.usefixtures("wrong_arrays")
def test_points_and_normals_make_a_cloud_and_a_pair_of_them_does_not(trained, mug):
    estimator = PoseEstimator(trained)
    same = estimator.estimate(Cloud(mug.points, mug.normals), key=KEY)
    np.testing.assert_array_equal(same.pose, estimator.estimate(mug, key=KEY).pose)
    for pair in ((mug.points, mug.normals[:-1]), np.concatenate([mug.points, mug.normals], axis=1)):
        with pytest.raises(InputError, match=r"or with normals a Cloud\(points, normals\)"):
            estimator.estimate(pair, key=KEY)


@pytest.mark.parametrize("key", [0, None, "seed", jax.random.split(KEY, 3)])
@pytest.mark.usefixtures("wrong_arrays")
def test_what_is_no_key_is_one_line(trained, mug, key):
    estimator = PoseEstimator(trained)
    for ask in (
        lambda: estimator.estimate(mug, key=key),
        lambda: estimator.estimate_many([mug], key=key),
    ):
        with pytest.raises(InputError, match="key is .*; expected one such as jax.random.key"):
            ask()


def test_names_without_weights(monkeypatch, tmp_path):
    monkeypatch.setattr(module.resources, "files", lambda _: tmp_path)
    with pytest.raises(InputError, match="unknown category or type 'mgu'; did you mean mug"):
        PoseEstimator.load("mgu")
    with pytest.raises(InputError, match="no weights for mug .*manipose pose train mug"):
        PoseEstimator.load("mug")
    with pytest.raises(InputError, match="unknown number of cameras 'multi'"):
        PoseEstimator.load("mug", cameras="multi")


@pytest.mark.parametrize("name", ["cabinet", "articulated", "handle"])
def test_furniture_is_another_estimators(name, capsys):
    """The advice names what there is: a class of this package, and a command."""
    with pytest.raises(InputError, match=f"{name}: furniture has handles and joints") as caught:
        PoseEstimator.load(name)
    words = re.search(r"(\w+)\.load\(\) of (\S+) finds", str(caught.value))
    assert words is not None
    assert getattr(importlib.import_module(words[2]), words[1]) is ArticulatedEstimator
    command = re.search(r"`manipose (.+)`", str(caught.value))
    assert command is not None
    with pytest.raises(SystemExit) as ended:
        main([*command[1].split(), "--help"])
    assert ended.value.code == 0 and "handles and joints" in capsys.readouterr().out
    assert main(["pose", "evaluate", name, "--views", "1", "--jobs", "1"]) == 2
    assert str(caught.value) in capsys.readouterr().err


@pytest.mark.usefixtures("wrong_arrays")
@pytest.mark.parametrize("name", [["mug"], None, 3])
def test_what_is_no_name_is_one_line(name):
    with pytest.raises(InputError, match="category or type is .*; expected a name"):
        PoseEstimator.load(name)


def test_weights_of_furniture_are_another_estimators():
    path = Path(module.__file__).parent / "weights" / "furniture.npz"
    with pytest.raises(InputError, match="weights of furniture; ArticulatedEstimator reads them"):
        PoseEstimator.from_file(path)


def test_an_array_that_is_no_file_of_weights_is_named(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros(3))
    with pytest.raises(InputError, match="a.npy: not a whole file of weights"):
        load_weights(tmp_path / "a.npy")


def test_a_category_without_weights_gets_its_types(trained, monkeypatch, tmp_path):
    save_weights(tmp_path / "weights" / "mirror.npz", trained)
    monkeypatch.setattr(module.resources, "files", lambda _: tmp_path)
    assert PoseEstimator.load("mug").trained is PoseEstimator.load("mirror").trained


def test_weights_come_back_in_half_precision(trained, tmp_path):
    path = tmp_path / "mug.npz"
    save_weights(path, trained)
    back = load_weights(path)
    assert back.categories == ("mug",) and back.model.config == CONFIG
    for one, other in zip(jax.tree.leaves(trained.model), jax.tree.leaves(back.model), strict=True):
        assert np.allclose(one, other, rtol=1e-3, atol=1e-6)
    assert list(tmp_path.iterdir()) == [path]
    plain = tmp_path / "plain"
    plain.touch()
    assert path.stat().st_mode == plain.stat().st_mode  # others may read it, too


@pytest.mark.parametrize("kept", [0, 3, 200, -100])
def test_a_truncated_file_is_named(trained, tmp_path, kept):
    path = tmp_path / "mug.npz"
    save_weights(path, trained)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(InputError, match="mug.npz: not a whole file of weights"):
        PoseEstimator.from_file(path)


def _changed(path, change):
    """The file with another header, or other arrays."""
    with np.load(path) as stored:
        arrays = dict(stored)
    header = change(json.loads(bytes(arrays["header"])), arrays)
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(path, **arrays)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda header, _: [1], "a header that is no dictionary"),
        (lambda header, _: header | {"kind": ["ours"]}, "weights of method .*'ours'.*knows ours"),
        (lambda header, _: header | {"config": [1]}, "do not fit their configuration"),
        (
            lambda header, _: header | {"config": header["config"] | {"pairs": "many"}},
            "do not fit their configuration",
        ),
        (lambda header, _: header | {"cameras": "three"}, "do not fit their configuration"),
        (lambda header, _: header | {"labels": ["unified"]}, "do not fit their configuration"),
        (
            lambda header, _: header | {"config": header["config"] | {"symmetry": None}},
            "do not fit their configuration",
        ),
        (
            lambda header, arrays: arrays.update(leaf_000=arrays["leaf_000"] * np.nan) or header,
            "weights that are not finite",
        ),
        (
            lambda header, arrays: arrays.update(leaf_000=arrays["leaf_000"].astype(str)) or header,
            "do not fit their configuration",
        ),
    ],
)
def test_weights_with_a_wrong_header_or_values_are_named(trained, tmp_path, change, words):
    path = tmp_path / "mug.npz"
    save_weights(path, trained)
    _changed(path, change)
    with pytest.raises(InputError, match=f"mug.npz: .*{words}") as caught:
        load_weights(path)
    assert "\n" not in str(caught.value)


def test_a_compression_that_no_reader_knows_is_a_damaged_file(trained, tmp_path):
    path = tmp_path / "mug.npz"
    save_weights(path, trained)
    for offset, value in ((8, 99), (6, 1)):  # of the first local header: method, flag of a password
        stored = bytearray(path.read_bytes())
        central = stored.index(b"PK\x01\x02")
        stored[offset] = stored[central + offset + 2] = value
        (tmp_path / "odd.npz").write_bytes(bytes(stored))
        with pytest.raises(InputError, match="odd.npz: not a whole file of weights"):
            load_weights(tmp_path / "odd.npz")


def test_weights_of_another_version_are_named(trained, tmp_path, monkeypatch):
    path = tmp_path / "mug.npz"
    monkeypatch.setattr("manipose_mj.ppf_jax.weight_files.FORMAT_VERSION", 99)
    save_weights(path, trained)
    monkeypatch.undo()
    with pytest.raises(InputError, match="weights of format 99; this version reads 2"):
        PoseEstimator.from_file(path)
    with pytest.raises(InputError, match="no such file"):
        PoseEstimator.from_file(tmp_path / "none.npz")
