"""The weights that ship for furniture do what docs/guides/pose_estimation.md says of them."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest

from manipose_mj.ppf_jax.articulated_estimator import ArticulatedEstimator
from manipose_mj.ppf_jax.data.articulated.cache import furniture_names, furniture_scenes
from manipose_mj.ppf_jax.evaluation.part_evaluation import evaluated, scene_clouds
from manipose_mj.ppf_jax.evaluation.part_metrics import summary

FOLDER = Path(str(resources.files("manipose_mj.ppf_jax"))) / "weights"


@pytest.mark.full
@pytest.mark.usefixtures("optimised")
def test_they_reproduce_published_shares():
    """Of every fifth test object, half of the scenes that docs/guides/pose_estimation.md counts, three views fused."""
    scenes = furniture_scenes(furniture_names("test")[::5], "front", scenes=4)
    estimator = ArticulatedEstimator.load()
    assert (FOLDER / "furniture.npz").stat().st_size < 2e6
    found = evaluated(estimator, scene_clouds(scenes, fused=3))
    figures = summary(found.errors, found.false_positives, found.clouds)
    assert figures["n"] == 32
    # One of 32 parts may be at the edge of a bar, and rounding differs between machines.
    assert figures["all_right"] == pytest.approx(0.906, abs=0.04)
    assert figures["joint_right"] == pytest.approx(0.906, abs=0.04)
    assert figures["false_positives_per_cloud"] < 0.2
