"""The penalty is chosen by the errors of the estimates, and changes nothing else of a model."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry
from manipose_mj.ppf_jax.rigid.model import ModelConfig, PoseModel
from manipose_mj.ppf_jax.rigid.model_sizes import category_config, model_config
from manipose_mj.ppf_jax.training.ambiguity_penalty import (
    PENALTIES,
    best_penalty,
    with_ambiguity_penalty,
)

AMBIGUOUS = np.array([[False, True]])


@pytest.mark.parametrize(
    ("degrees", "expected_error", "requested"),
    [
        # The ambiguous frame is right and scores a little better: no penalty.
        ([[90.0, 2.0]], [[0.30, 0.28]], 0.0),
        # It is wrong and scores better by 4 degrees: the least penalty beyond these.
        ([[2.0, 90.0]], [[0.30, 0.23]], np.radians(5.0)),
    ],
)
def test_the_best_answers_decide(degrees, expected_error, requested):
    assert best_penalty(np.array(degrees), np.array(expected_error), AMBIGUOUS) == pytest.approx(
        requested
    )
    assert requested in PENALTIES


def test_the_networks_stay():
    model = PoseModel(ModelConfig(), rng=np.random.default_rng(1))
    other = with_ambiguity_penalty(model, 0.5)
    assert other.config.refinement.ambiguity_penalty == 0.5
    assert other.refiner.config.ambiguity_penalty == 0.5
    for before, after in zip(jax.tree.leaves(model), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(before, after)


def _cloud(category):
    points, pose = np.ones((40, 3), np.float32), np.eye(4, dtype=np.float32)
    label = catalogue.generate(category, 0).label
    extents = np.ones(3, np.float32)
    return LabelledCloud(points, points, pose, extents, label.symmetry, f"{category}/0", category)


def test_several_categories_get_a_larger_model():
    one = model_config([_cloud("mug")])
    many = model_config([_cloud("mug"), _cloud("box")])
    assert one == category_config(CommonSymmetry())
    assert many.symmetry == CommonSymmetry(boxes=True)
    assert many.network.lines and many.network.width > one.network.width
    sizes = [
        sum(leaf.size for leaf in jax.tree.leaves(PoseModel(c, rng=np.random.default_rng(0))))
        for c in (one, many)
    ]
    assert 2 * sizes[0] < sizes[1] < 1e6  # 2 MB in half precision
