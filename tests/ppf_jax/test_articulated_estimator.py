"""The estimator of handles and joints takes any cloud, and its weights come back."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import jax
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax import articulated_estimator
from manipose_mj.ppf_jax.articulated import model as module
from manipose_mj.ppf_jax.articulated.model import ArticulatedConfig, ArticulatedModel
from manipose_mj.ppf_jax.articulated.part_network import (
    PartNetworkConfig,
)
from manipose_mj.ppf_jax.articulated.part_voting import PartVotingConfig
from manipose_mj.ppf_jax.articulated_estimator import ArticulatedEstimator
from manipose_mj.ppf_jax.data.articulated.clouds import (
    CLOUD_POINTS,
    fused_cloud,
)
from manipose_mj.ppf_jax.rigid.network import NetworkConfig
from manipose_mj.ppf_jax.training.articulated_losses import ArticulatedLoss
from manipose_mj.ppf_jax.weight_files import TrainedModel, load_weights, save_weights

KEY = jax.random.key(0)
CONFIG = ArticulatedConfig(
    body=NetworkConfig(neighbours=4, anchors=4, local_width=8, width=8, pair_width=8),
    body_points=64,
    body_pairs=1000,
    network=PartNetworkConfig(
        width=8, hidden=8, neighbours=4, among=(128, 64), reach=(0.03, 0.1), anchors=4
    ),
    voting=PartVotingConfig(parts=4, candidates=32),
    points=128,
)


@pytest.fixture(scope="module")
def estimator():
    return ArticulatedEstimator(ArticulatedModel(CONFIG, rng=np.random.default_rng(1)))


@pytest.mark.full
def test_any_cloud_gets_answers_that_are_finite_and_repeatable(estimator, scene, monkeypatch):
    cloud = fused_cloud(scene, [0])
    traced = []
    whole = module.estimate_parts
    monkeypatch.setattr(
        module,
        "estimate_parts",
        lambda *args, key: traced.append(len(args[1])) or whole(*args, key=key),
    )
    answers = [
        estimator.estimate(cloud.points[:count], key=KEY, least=0.0) for count in (300, 999, 999)
    ]
    assert set(traced) == {2048}
    assert all(len(parts) == CONFIG.voting.parts for parts in answers)
    for part in answers[0]:
        assert np.isfinite(part.handle).all() and np.isfinite(part.axis_origin).all()
        # Also of a part that no point votes for.
        assert np.linalg.det(part.handle[:3, :3]) == pytest.approx(1.0, abs=1e-3)
        assert np.linalg.norm(part.axis) == pytest.approx(1.0, abs=1e-3)
        np.testing.assert_allclose(
            part.handle[:3, :3] @ part.handle[:3, :3].T, np.eye(3), atol=1e-3
        )
        assert part.opening >= 0 and 0 <= part.confidence <= 1
    for one, other in zip(answers[1], answers[2], strict=True):
        assert np.array_equal(one.handle, other.handle)


@pytest.mark.parametrize(
    ("count", "size"),
    [(300, 2048), (2049, 8192), (9000, 32_768), (65_000, 65_536), (70_000, 65_536)],
)
def test_clouds_are_padded_to_few_sizes(estimator, scene, monkeypatch, count, size):
    """One compilation each; none of a large cloud is dropped."""

    class Enough(Exception):
        pass

    def stopped(model, points, normals, mask, up, *, key):
        assert points.shape == normals.shape == (1, size, 3)
        assert mask.sum() == min(count, CLOUD_POINTS)
        raise Enough

    monkeypatch.setattr(articulated_estimator, "estimate_furniture", stopped)
    view = scene.views[0]
    rows = np.arange(count) % len(view.points)
    apart = np.random.default_rng(0).normal(0, 1e-3, (count, 3)).astype(np.float32)
    cloud = SimpleNamespace(points=view.points[rows] + apart, normals=view.normals[rows])
    with pytest.raises(Enough):
        estimator.estimate(cloud, key=KEY)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p[:40], "cloud of 40 points; expected at least 256"),
        (lambda p: p * 1000, r"millimetres\? divide by 1000"),
        (lambda p: p * 0 + 1, "all points are equal"),
        (lambda p: p[:, :2], r"expected numbers, \(points, 3\)"),
        (
            lambda p: np.where(np.arange(len(p))[:, None] < 3, np.nan, p),
            "3 of .* points are not finite",
        ),
    ],
)
@pytest.mark.usefixtures("wrong_arrays")
def test_clouds_that_cannot_be_used(estimator, scene, change, message):
    with pytest.raises(InputError, match=message):
        estimator.estimate(change(scene.views[0].points), key=KEY)


@pytest.mark.parametrize("up", [(0, 0, 0), "abc", (0, "z", 1), None])
@pytest.mark.usefixtures("wrong_arrays")
def test_an_up_that_is_no_direction(estimator, scene, up):
    with pytest.raises(InputError, match="up is .*; expected a direction"):
        estimator.estimate(scene.views[0].points, key=KEY, up=up)


def test_weights_come_back(estimator, tmp_path):
    path = tmp_path / "furniture.npz"
    save_weights(path, TrainedModel(estimator.model, ("cabinet",)))
    again = ArticulatedEstimator.from_file(path)
    assert again.model.config == CONFIG
    leaves = zip(jax.tree.leaves(again.model), jax.tree.leaves(estimator.model), strict=True)
    for one, other in leaves:
        np.testing.assert_allclose(one, other, rtol=1e-3, atol=1e-3)
    assert load_weights(path).categories == ("cabinet",)
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(InputError, match="not a whole file of weights"):
        ArticulatedEstimator.from_file(path)


@pytest.mark.full
def test_training_steps_have_gradients_for_every_weight(estimator, sample):
    few = jax.tree.map(lambda leaf: leaf, sample)
    few = dataclasses.replace(
        few, **{n: getattr(few, n)[:128] for n in ("points", "normals", "mask", "part", "handle")}
    )
    loss = ArticulatedLoss(pairs=50, wrong_front=0.0)

    def total(model, key):
        return loss(model, few, key=key)[0]

    gradient = jax.jit(jax.grad(total))(estimator.model, KEY)
    leaves = jax.tree.leaves_with_path(gradient)
    assert all(np.isfinite(leaf).all() for _, leaf in leaves)
    still = [jax.tree_util.keystr(path) for path, leaf in leaves if not np.any(leaf)]
    # Extents are not asked for, and confidence is fitted afterwards.
    assert all("size" in name or "calibration" in name for name in still), still
