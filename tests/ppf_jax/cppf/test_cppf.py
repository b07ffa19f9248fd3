"""CPPF's baseline: votes that know the truth give it back to the grid's precision; its losses fall."""

from __future__ import annotations

import dataclasses
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.cppf.model import CppfLoss, CppfModel, cppf_config, unoriented
from manipose_mj.ppf_jax.cppf.voting import CppfOutputs, directed, towards, voted_estimate
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.points.clouds import batch_clouds
from manipose_mj.ppf_jax.training.loop import CURVE_FILE, TrainingConfig, train
from manipose_mj.ppf_jax.training.methods import METHODS
from manipose_mj.ppf_jax.weight_files import TrainedModel, load_weights, save_weights
from tests.ppf_jax.half_visible import half_visible_clouds

PAIRS = 3000


@pytest.fixture(scope="module")
def mugs():
    return half_visible_clouds("mug", [0], 4, points=200)


@pytest.fixture(scope="module")
def config(mugs):
    small = dataclasses.replace(cppf_config(mugs), pairs=PAIRS, cone_pairs=1000, neighbours=20)
    return dataclasses.replace(small, center_bins=128, angle_bins=128)


def _sure(value, longest, bins):
    """Logits that put a value into one bin."""
    bin_ = jnp.round(jnp.clip(value / longest, 0, 1) * (bins - 1)).astype(int)
    return 50.0 * jax.nn.one_hot(bin_, bins)


def test_the_settings_cover_the_objects(mugs, config):
    far = max(np.linalg.norm(c.points - c.pose[:3, 3], axis=1).max() for c in mugs)
    assert config.reach[0] == pytest.approx(far, rel=0.05)
    stray = dataclasses.replace(mugs[0], points=mugs[0].points.copy(), normals=mugs[0].normals)
    stray.points[0] = [0, 0, 4]
    assert cppf_config([*mugs, stray]).reach == pytest.approx(config.reach, rel=0.02)
    assert np.allclose(np.exp(config.mean_log_extents), mugs[0].extents, rtol=1e-3)
    assert not config.symmetry.axial
    assert config.symmetry.unsigned_x  # as published for mugs, whose ends differ


def test_normals_do_not_tell_the_side_that_is_seen(mugs):
    normals = jnp.asarray(mugs[0].normals)
    signed = unoriented(normals)
    assert jnp.array_equal(signed, unoriented(-normals))
    assert jnp.array_equal(jnp.abs(signed), jnp.abs(normals))
    axes = jnp.eye(3)
    assert jnp.array_equal(unoriented(-axes), jnp.diag(jnp.array([1.0, -1.0, 1.0])))


@pytest.mark.full
def test_votes_that_know_the_truth_give_it_back(mugs, config):
    """The centre to a cell or two, each axis to the spacing of the directions."""
    cloud = mugs[0]
    middle = cloud.points.mean(axis=0)
    rng = np.random.default_rng(0)
    first, second = (jnp.asarray(r) for r in rng.integers(0, len(cloud), (2, PAIRS)))
    # A stray point that no pair is of must not move the grid away from the object.
    points = jnp.append(jnp.asarray(cloud.points - middle), -3 * jnp.ones((1, 3)), axis=0)
    normals = jnp.append(jnp.asarray(cloud.normals), jnp.eye(3)[:1], axis=0)
    along, _ = directed(points, first, second)
    offset = points[first] - (cloud.pose[:3, 3] - middle)
    mu = jnp.sum(offset * along, axis=1)
    nu = jnp.linalg.norm(offset - mu[:, None] * along, axis=1)
    angles = jnp.arccos(jnp.clip(along @ cloud.pose[:3, :2], -1, 1))
    facing = towards(normals[first], along)
    out = CppfOutputs(
        mu=_sure(mu + config.reach[0], 2 * config.reach[0], config.center_bins),
        nu=_sure(nu, config.reach[1], config.center_bins),
        angles=_sure(angles, np.pi, config.angle_bins),
        signs=10.0 * jnp.sign(facing @ cloud.pose[:3, :2]),
        log_extents=jnp.zeros((PAIRS, 3)),
    )
    mask = jnp.ones(len(points), bool)
    found = jax.jit(lambda *a: voted_estimate(*a, config, key=jax.random.key(0)))(
        out, points, normals, mask, first, second
    )
    pose = np.asarray(found.poses[0])
    assert np.linalg.norm(pose[:3, 3] + middle - cloud.pose[:3, 3]) < 2 * config.cell
    degrees = np.degrees(np.arccos(np.sum(pose[:3, :2] * cloud.pose[:3, :2], axis=0)))
    assert np.all(degrees < 12)
    assert np.allclose(found.extents[0], cloud.extents, rtol=1e-3)
    assert float(found.confidence[0]) > 0.8


@pytest.mark.full
def test_it_trains_estimates_and_is_kept(mugs, config, tmp_path):
    def batches(start):
        while True:
            yield batch_clouds(mugs, rng=np.random.default_rng(0), points=128)

    training = TrainingConfig(steps=30, warmup=2, log_every=1, loss=CppfLoss(pairs=200))
    model = train(batches, config, training, tmp_path, build=CppfModel)
    curve = json.loads((tmp_path / CURVE_FILE).read_text())
    for part in ("mu", "nu", "x", "y"):
        assert np.mean([r[part] for r in curve[-3:]]) < np.mean([r[part] for r in curve[:3]]), part
    path = tmp_path / "cppf.npz"
    save_weights(path, TrainedModel(model, ("mug",), "original"))
    back = load_weights(path)
    assert (back.method, back.labels, back.model.config) == ("cppf", "original", config)
    assert PoseEstimator.from_file(path, method="cppf", labels="original").trained.labels
    with pytest.raises(InputError, match="weights of method cppf; expected ours"):
        PoseEstimator.from_file(path, method="ours")
    with pytest.raises(InputError, match="trained on original labels; expected unified"):
        PoseEstimator.from_file(path, labels="unified")
    batch = next(batches(0))
    few = batch.mask & (np.arange(batch.mask.shape[1]) < 12)  # fewer points than neighbours
    estimate = jax.jit(lambda *cloud: back.model.estimate(*cloud, key=jax.random.key(0)))
    for mask in (batch.mask, few):
        found = estimate(batch.points[0], batch.normals[0], mask[0])
        assert found.poses.shape == (1, 4, 4) and bool(jnp.all(jnp.isfinite(found.poses)))


def test_every_method_makes_a_model_that_its_weights_know(mugs):
    for name, method in METHODS.items():
        model = method.build(method.configured(mugs), rng=np.random.default_rng(0))
        assert TrainedModel(model, ("mug",)).method == name
        assert hash(method.training) and model.config.points <= 1024
