"""Parts as the baseline sees them come out of any cloud, in its camera's frame."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from manipose_mj.control.furniture.furniture_estimator import FurnitureEstimator
from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.data.articulated.cache import furniture_scenes
from manipose_mj.ppf_jax.evaluation.part_evaluation import scene_clouds
from manipose_mj.ppf_jax.evaluation.part_metrics import part_errors
from manipose_mj.ppf_jax.points.cloud_input import Cloud

KEY = jax.random.key(0)


@pytest.fixture(scope="module")
def clouds():
    return scene_clouds(
        furniture_scenes([("microwave", 9), ("oven", 9)], "front", scenes=2), fused=3
    )


@pytest.mark.full
@pytest.mark.usefixtures("optimised")
def test_handles_and_hinges_of_appliances_are_found(clouds):
    estimator = FurnitureEstimator.load()
    categories = [cloud.scene.category for cloud in clouds]
    found = estimator.estimate_many(clouds, categories, key=KEY)
    errors = [
        e for cloud, parts in zip(clouds, found, strict=True) for e in part_errors(cloud, parts)[0]
    ]
    assert len(errors) >= 3
    assert all(error.handle_right for error in errors)
    # A shut oven's hinge is above its sill, though both are in one plane.
    assert all(error.line < 0.035 for error in errors)
    # A camera that lies on its side says so; the answer is the same, in its frame.
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    lying = Cloud(clouds[0].points @ turn.T, clouds[0].normals @ turn.T)
    up = tuple(turn @ [0.0, -1.0, 0.0])
    turned = estimator.estimate(lying, categories[0], key=KEY, up=up)
    assert len(turned) == len(found[0])
    for part, other in zip(found[0], turned, strict=True):
        np.testing.assert_allclose(turn @ part.handle[:3, 3], other.handle[:3, 3], atol=0.01)


def test_clouds_and_categories_go_together():
    estimator, some = FurnitureEstimator.load(), np.random.default_rng(0).random((300, 3))
    with pytest.raises(InputError, match="2 clouds and 1 categories; expected one each"):
        estimator.estimate_many([some, some], ["oven"], key=KEY)
    with pytest.raises(InputError, match=r"cloud 1: cloud of 9 points; expected at least 256"):
        estimator.estimate_many([some, some[:9]], ["oven", "oven"], key=KEY)
