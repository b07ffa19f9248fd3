"""The pose table's rows say what was measured, and what is missing is named and left out."""

from __future__ import annotations

import importlib

import numpy as np
import pytest

from manipose_mj.poses import SymmetryGroup, compose, rotation_about
from manipose_mj.ppf_jax.data.source_frames import SourceLabel
from manipose_mj.ppf_jax.data.view_cache import catalogue_clouds, source_labels
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.evaluation.pose_metrics import pose_errors, summary
from manipose_mj.ppf_jax.evaluation.pose_predictions import predict
from manipose_mj.ppf_jax.points.clouds import LabelledCloud


@pytest.fixture(scope="module")
def table():
    return importlib.import_module("pose_table")


@pytest.fixture(scope="module")
def signs():
    return importlib.import_module("lost_signs")


def cloud(name: str, pose: np.ndarray) -> LabelledCloud:
    zeros, extents = np.zeros((40, 3), np.float32), np.ones(3, np.float32)
    group = SymmetryGroup.identity()
    return LabelledCloud(zeros, zeros, pose.astype(np.float32), extents, group, name, "object")


def test_one_frame_for_all_is_the_one_that_suits_most(table):
    turned = compose(rotation_about(np.eye(3)[2], np.pi / 2), np.array([0.0, 0.0, 0.1]))
    frames = {
        name: SourceLabel("PACE", frame, np.ones(3), SymmetryGroup.identity())
        for name, frame in (("a", turned), ("b", np.eye(4)), ("c", np.eye(4)))
    }
    poses = [compose(rotation_about(np.eye(3)[0], i), np.array([0.0, 0.0, 0.7])) for i in range(3)]
    clouds = [cloud(f"{name}/0", pose) for name, pose in zip("abc", poses, strict=True)]
    found = table._one_frame(clouds, frames)
    errors = pose_errors(found.poses, clouds, sources=frames)
    np.testing.assert_allclose(np.degrees(errors.rotation), [90, 0, 0], atol=0.05)
    np.testing.assert_allclose(errors.origin, [0.1, 0, 0], atol=1e-6)


def test_weights_that_are_not_there_are_named_and_left_out(table, tmp_path, caplog):
    assert table.estimator_of("cup", tmp_path, "cppf", "original") is None
    assert "cup-cppf-original/weights.npz: no such file" in caplog.text
    assert table.estimator_of("cup", tmp_path, "ours", "unified").trained.method == "ours"


@pytest.mark.parametrize("labels", ["unified", "original"])
@pytest.mark.parametrize("method", ["cppf", "ours"])
def test_weights_of_every_row_are_beside_the_table(table, method, labels):
    for category in table.PAPER:
        trained = table.estimator_of(category, table.WEIGHTS, method, labels).trained
        assert (trained.method, trained.labels) == (method, labels)
        assert trained.categories == (category,)
        path = table.WEIGHTS / table.folder_name(category, method, labels) / table.WEIGHTS_FILE
        assert not path.exists() or path.stat().st_size < 2e6


@pytest.mark.full
@pytest.mark.usefixtures("optimised")
def test_they_reproduce_published_figures_of_bowls(table):
    """Of CPPF, which votes for seconds over each cloud, those of one view of each of eight objects."""
    clouds = catalogue_clouds("bowl", "test", view_setting("anywhere"), views=4, jobs=1)
    frames = source_labels(clouds)
    found = predict(table.estimator_of("bowl", table.WEIGHTS, "ours", "original"), clouds, timed=0)
    figures = summary(pose_errors(found.poses, clouds, sources=frames))
    assert figures["origin_cm_mean"] == pytest.approx(2.06, abs=0.1)
    assert figures["recall_5deg_5cm"] == pytest.approx(0.5, abs=0.05)

    few = catalogue_clouds("bowl", "test", view_setting("anywhere"), views=1, jobs=1)[:8]
    found = predict(table.estimator_of("bowl", table.WEIGHTS, "cppf", "unified"), few, timed=0)
    figures = summary(pose_errors(found.poses, few))
    assert figures["origin_cm_mean"] == pytest.approx(0.90, abs=0.1)
    assert figures["deg_mean"] == pytest.approx(7.7, abs=1.0)


def test_the_table_holds_rows_with_and_without_figures(table):
    rows = [table._row("cup", "paper", "unified", {"origin_cm_mean": 0.57, "deg_mean": 4.1})]
    assert rows[0]["n"] is None and rows[0]["deg_median"] is None
    figures = {"origin_cm_mean": 1.0, "origin_cm_median": 0.9, "deg_mean": 3.0, "deg_median": 2.0}
    figures |= {f"recall_{d}deg_{c}cm": 0.5 for d, c in table.SHOWN_RECALLS} | {"flipped": 0.25}
    rows.append(table._row("cup", "some", "unified", {**figures, "ms_per_object": np.nan, "n": 4}))
    assert rows[1]["ms_per_object"] is None
    assert table.table_of(rows, "anywhere").row_count == 2
    assert "50 50 50" in table._cell(rows[1]) and "flipped 25.0%" in table._cell(rows[1])


def test_signs_are_lost_by_half_turns_alone(signs):
    x, y, _ = np.eye(3)
    truth = rotation_about(np.array([0.6, 0.0, 0.8]), 1.0)
    one, planes = SymmetryGroup.identity(), SymmetryGroup.two_planes()
    round_x = SymmetryGroup.about_x()
    assert signs.reversed_axes(truth @ rotation_about(x, np.pi), truth, one) == (False, True)
    assert signs.reversed_axes(truth @ rotation_about(y, np.pi), truth, one) == (True, False)
    assert signs.reversed_axes(truth @ rotation_about(x, np.pi), truth, planes) == (False, False)
    assert signs.reversed_axes(truth @ rotation_about(y, 3.0), truth, round_x) == (True, False)
    assert signs.reversed_axes(truth @ rotation_about(x, 3.0), truth, round_x) == (False, False)

    seen = cloud("a/0", compose(truth, np.zeros(3)))
    turned = compose(truth @ rotation_about(y, np.pi - np.radians(7)), np.zeros(3))
    row = signs.row_of("object", "anywhere", [seen], turned[None])
    assert row["deg_mean"] == pytest.approx(173, abs=0.01)
    assert row["signs_given_deg_mean"] == pytest.approx(7, abs=0.01)
    assert (row["x_reversed"], row["y_reversed"]) == (1, 0)
