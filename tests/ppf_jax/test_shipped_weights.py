"""The weights that ship do what docs/pose.md says of them."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from manipose_mj.ppf_jax.articulated_cache import furniture_names, furniture_scenes
from manipose_mj.ppf_jax.articulated_estimator import ArticulatedEstimator
from manipose_mj.ppf_jax.articulated_evaluation import evaluated, scene_clouds
from manipose_mj.ppf_jax.articulated_metrics import summary as part_summary
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.evaluation import answers
from manipose_mj.ppf_jax.metrics import pose_errors, summary
from manipose_mj.ppf_jax.view_cache import catalogue_clouds
from manipose_mj.ppf_jax.view_settings import view_setting

FOLDER = Path(str(resources.files("manipose_mj.ppf_jax"))) / "weights"
# Published: cm, deg. Means; medians where a few views are mistaken for another side, which weighs on a mean.
MEANS = {"bowl": (0.10, 0.7), "cup": (0.07, 0.57), "hammer": (0.15, 0.94), "plate": (0.10, 0.41)}
MEDIANS = {"box": (0.16, 0.71), "mug": (0.11, 1.27), "razor": (0.08, 1.00)}


@pytest.mark.parametrize("name", [*MEANS, *MEDIANS])
def test_they_load_and_are_small(name):
    assert PoseEstimator.load(name).trained.categories == (name,)
    assert (FOLDER / f"{name}.npz").stat().st_size < 2e6


def test_a_category_without_weights_gets_its_type_s():
    for name, object_type in (
        ("chips_can", "axial"),
        ("teapot", "mirror"),
        ("pencil", "functional"),
    ):
        assert PoseEstimator.load(name).trained is PoseEstimator.load(object_type).trained
        assert name in PoseEstimator.load(name).trained.categories
        assert (FOLDER / f"{object_type}.npz").stat().st_size < 2e6


@pytest.mark.parametrize(
    ("name", "category", "cm", "deg"),
    [
        ("axial", "cup", 0.08, 0.56),
        ("mirror", "steel_tape", 0.20, 1.67),
        ("functional", "squeegee", 0.21, 1.05),
    ],
)
def test_those_of_a_type_reproduce_a_published_figure(name, category, cm, deg):
    clouds = catalogue_clouds(category, "test", view_setting("anywhere"), views=4, jobs=1)
    found = answers(PoseEstimator.load(name), clouds, timed=0)
    figures = summary(pose_errors(found.poses, clouds))
    assert figures["deg_median"] == pytest.approx(deg, abs=0.1)
    assert figures["origin_cm_median"] == pytest.approx(cm, abs=0.02)
    assert figures["flipped"] == 0.0


@pytest.mark.parametrize("name", [*MEANS, *MEDIANS])
def test_they_reproduce_their_published_figures(name):
    clouds = catalogue_clouds(name, "test", view_setting("anywhere"), views=16, jobs=1)
    found = answers(PoseEstimator.load(name), clouds, timed=0)
    figures = summary(pose_errors(found.poses, clouds))
    cm, deg = (MEANS | MEDIANS)[name]
    kind = "mean" if name in MEANS else "median"
    assert len(clouds) == 160
    # The last digit of the table, and what the rounding of another machine may turn.
    assert figures[f"origin_cm_{kind}"] == pytest.approx(cm, abs=0.01)
    assert figures[f"deg_{kind}"] == pytest.approx(deg, abs=0.1)
    assert figures["flipped"] <= (0.01 if name == "razor" else 0.0)
    assert np.isfinite(found.confidence).all()


def test_furniture_s_reproduce_published_shares():
    """Of every fifth test object, half of the scenes that docs/pose.md counts, three views fused."""
    scenes = furniture_scenes(furniture_names("test")[::5], "front", scenes=4)
    estimator = ArticulatedEstimator.load()
    assert (FOLDER / "furniture.npz").stat().st_size < 2e6
    found = evaluated(estimator, scene_clouds(scenes, fused=3))
    figures = part_summary(found.errors, found.strange, found.clouds)
    assert figures["n"] == 32
    # One of 32 parts may be at the edge of a bar: tests compile without optimisation.
    assert figures["all_right"] == pytest.approx(0.906, abs=0.04)
    assert figures["joint_right"] == pytest.approx(0.906, abs=0.04)
    assert figures["strange_per_cloud"] < 0.2
