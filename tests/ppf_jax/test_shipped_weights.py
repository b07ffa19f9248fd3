"""The weights that ship do what docs/guides/pose_estimation.md says of them."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from manipose_mj.ppf_jax.data.view_cache import catalogue_clouds
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.evaluation.pose_metrics import pose_errors, summary
from manipose_mj.ppf_jax.evaluation.pose_predictions import predict

FOLDER = Path(str(resources.files("manipose_mj.ppf_jax"))) / "weights"
# Published: cm, deg. Means; medians where a few views are mistaken for another side, which weighs on a mean.
MEANS = {"bowl": (0.08, 0.56), "cup": (0.08, 0.42), "hammer": (0.15, 0.98), "plate": (0.08, 0.33)}
MEDIANS = {"box": (0.14, 0.64), "mug": (0.11, 1.22), "razor": (0.08, 0.97)}


@pytest.mark.parametrize("name", [*MEANS, *MEDIANS])
def test_they_load_and_are_small(name):
    assert PoseEstimator.load(name).trained.categories == (name,)
    assert (FOLDER / f"{name}.npz").stat().st_size < 2e6


@pytest.mark.full
@pytest.mark.parametrize("name", [*MEANS, *MEDIANS])
def test_they_reproduce_their_published_figures(name):
    clouds = catalogue_clouds(name, "test", view_setting("anywhere"), views=16, jobs=1)
    found = predict(PoseEstimator.load(name), clouds, timed=0)
    figures = summary(pose_errors(found.poses, clouds))
    cm, deg = (MEANS | MEDIANS)[name]
    kind = "mean" if name in MEANS else "median"
    assert len(clouds) == 160
    # The last digit of the table, and what the rounding of another machine may turn.
    assert figures[f"origin_cm_{kind}"] == pytest.approx(cm, abs=0.01)
    assert figures[f"deg_{kind}"] == pytest.approx(deg, abs=0.1)
    assert figures["flipped"] <= (0.01 if name == "razor" else 0.0)
    assert np.isfinite(found.confidence).all()
