"""The handicap is chosen by what its answers are worth, and changes nothing else of a model."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from asset_pipeline.catalogue import CATALOGUE
from manipose_mj.ppf_jax.clouds import LabelledCloud
from manipose_mj.ppf_jax.handicap import HANDICAPS, least_off, with_handicap
from manipose_mj.ppf_jax.model import ModelConfig, PoseModel
from manipose_mj.ppf_jax.model_sizes import category_config, model_config
from manipose_mj.ppf_jax.symmetry import CommonSymmetry

RELATED = np.array([[False, True]])


@pytest.mark.parametrize(
    ("degrees", "doubt", "wanted"),
    [
        # The related frame is right and judged a little better: no handicap.
        ([[90.0, 2.0]], [[0.30, 0.28]], 0.0),
        # It is wrong and judged better by 4 degrees: the least handicap beyond these.
        ([[2.0, 90.0]], [[0.30, 0.23]], np.radians(5.0)),
    ],
)
def test_the_best_answers_decide(degrees, doubt, wanted):
    assert least_off(np.array(degrees), np.array(doubt), RELATED) == pytest.approx(wanted)
    assert wanted in HANDICAPS


def test_the_networks_stay():
    model = PoseModel(ModelConfig(), rng=np.random.default_rng(1))
    other = with_handicap(model, 0.5)
    assert other.config.refinement.related_handicap == 0.5
    assert other.refiner.config.related_handicap == 0.5
    for before, after in zip(jax.tree.leaves(model), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(before, after)


def _cloud(category):
    points, pose = np.ones((40, 3), np.float32), np.eye(4, dtype=np.float32)
    label = CATALOGUE[category].generate(0).label
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
