"""The weights that ship for whole types do what docs/pose.md says of them."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest

from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.evaluation import answers
from manipose_mj.ppf_jax.metrics import pose_errors, summary
from manipose_mj.ppf_jax.view_cache import catalogue_clouds
from manipose_mj.ppf_jax.view_settings import view_setting

FOLDER = Path(str(resources.files("manipose_mj.ppf_jax"))) / "weights"


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
    ("name", "category", "cm", "deg", "flipped"),
    [
        ("axial", "cup", 0.06, 0.32, 0),
        ("mirror", "steel_tape", 0.19, 1.97, 1),
        ("functional", "squeegee", 0.16, 0.94, 0),
    ],
)
def test_those_of_a_type_reproduce_a_published_figure(name, category, cm, deg, flipped):
    clouds = catalogue_clouds(category, "test", view_setting("anywhere"), views=4, jobs=1)
    found = answers(PoseEstimator.load(name), clouds, timed=0)
    figures = summary(pose_errors(found.poses, clouds))
    assert figures["deg_median"] == pytest.approx(deg, abs=0.1)
    assert figures["origin_cm_median"] == pytest.approx(cm, abs=0.02)
    assert len(clouds) == 40
    assert round(40 * figures["flipped"]) == flipped
