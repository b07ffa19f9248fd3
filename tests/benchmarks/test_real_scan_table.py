"""The table of real scans holds each against the right column and asks the right network."""

from __future__ import annotations

import importlib
from types import SimpleNamespace

import numpy as np
import pytest

from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.evaluation.pose_metrics import PoseErrors
from manipose_mj.ppf_jax.points.clouds import LabelledCloud


@pytest.fixture(scope="module")
def table():
    return importlib.import_module("real_scan_table")


def test_the_bar_is_the_categorys_or_its_types(table):
    assert table.bar_of("mug", "mirror") == (0.80, 8.8)
    assert table.bar_of("can", "axial") == pytest.approx(((1.23 + 0.57) / 2, (5.1 + 4.1) / 2))
    assert table.bar_of("drill", "functional") == pytest.approx((1.44, 10.5))


def test_means_and_medians_have_to_be_within(table):
    figures = ("a", "cup", "cup", True, 10)
    within = table.Row(*figures, 0.5, 0.2, 4.0, 2.0, 4.0, 90.0, 0.0, 0.57, 4.1)
    far = table.Row(*figures, 0.5, 0.3, 4.0, 2.0, 4.0, 90.0, 0.0, 0.57, 4.1)
    turned = table.Row(*figures, 0.5, 0.2, 4.2, 2.0, 4.2, 90.0, 0.0, 0.57, 4.1)
    assert [row.within for row in (within, far, turned)] == [True, False, False]


def test_bars_that_do_not_count_are_told(table):
    """A flat bottle is of a category of round objects: the catalogue has none of its type."""
    figures = (10, 0.5, 0.2, 4.0, 2.0, 4.0, 90.0, 0.0, 0.57)
    cup = table.Row("a", "cup", "cup", True, *figures, 4.1)
    flat = table.Row("flat", "bottle", "axial, mirror", False, *figures, 3.0)
    ball = table.Row("ball", "ball", "mirror", False, *figures, 4.1)
    told, last = table.verdict([cup, flat, ball])
    assert told.startswith("bars of 2 scans not counted")
    assert told.endswith(": flat (missed), ball (met)")
    assert last == "all bars of 1 counted scans met"
    assert table.verdict([cup]) == [last]
    assert table.verdict([flat])[1] == "no bar counts"
    far = table.Row("b", "cup", "cup", True, *figures, 3.0)
    assert table.verdict([cup, far]) == ["missed: b"]


def test_a_carton_with_a_front_is_none_of_the_boxes(table):
    boxes = PoseEstimator.load("box")
    assert table.fits(SymmetryGroup.three_planes(), boxes)
    assert not table.fits(SymmetryGroup.identity(), boxes)
    assert table.fits(SymmetryGroup.identity(), PoseEstimator.load("hammer"))
    assert not table.fits(SymmetryGroup.identity(), PoseEstimator.load("cup"))


def test_turns_about_the_axis_count_where_the_category_has_a_side(table):
    def scan(category, object_type, group):
        label = SimpleNamespace(object_type=object_type, symmetry=group)
        return SimpleNamespace(category=category, label=label)

    own = SymmetryGroup.identity()
    assert table.kind_symmetry(scan("screwdriver", "functional", own)).axial
    assert table.kind_symmetry(scan("hammer", "functional", own)) is own
    assert table.kind_symmetry(scan("bottle", "mirror", own)) is own  # an oval one
    assert table.kind_symmetry(scan("banana", "mirror", own)) is own


def test_the_worst_views_are_drawn_worst_first(table, tmp_path):
    rng = np.random.default_rng(0)
    clouds = []
    for i in range(3):
        points = rng.normal(scale=0.03, size=(50, 3)).astype(np.float32)
        pose, size = np.eye(4, dtype=np.float32), np.full(3, 0.1, np.float32)
        group = SymmetryGroup.identity()
        clouds.append(LabelledCloud(points, points, pose, size, group, f"cup/{i}", "cup"))
    rotation = np.radians([1.0, 30.0, 5.0])
    errors = PoseErrors(rotation / 100, rotation, rotation, rotation, rotation)
    lines = table.draw_worst(tmp_path, 2, clouds, np.stack([np.eye(4)] * 3), errors)
    assert [line.split()[1] for line in lines] == ["cup/1:", "cup/2:"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["worst_01.png", "worst_02.png"]
