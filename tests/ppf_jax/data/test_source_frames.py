"""Frames of the sources are rigid, documented ones, and errors in them are counted fairly."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup, compose, rotation_about, transform
from manipose_mj.ppf_jax.data.source_frames import (
    SOURCES,
    SourceLabel,
    assigned_source,
    label_bounds,
    source_label,
    with_source_frames,
)
from manipose_mj.ppf_jax.evaluation.pose_metrics import pose_errors
from manipose_mj.ppf_jax.points.clouds import LabelledCloud

CATEGORIES = ("bowl", "mug", "box", "hammer", "razor")
AT = compose(rotation_about(np.array([0.6, 0.0, 0.8]), 0.7), np.array([0.1, -0.05, 0.8]))


def specimen(category: str) -> tuple[PoseLabel, np.ndarray]:
    made = catalogue.generate(category, 2)
    return made.label, np.asarray(made.bodies[0].surface().vertices)


def frame(category: str, source: str, name: str = "a") -> tuple[SourceLabel, np.ndarray]:
    """The source's label, and the surface in its frame."""
    label, vertices = specimen(category)
    own = source_label(name, label, label_bounds(label, vertices), source)  # type: ignore[arg-type]
    T_mesh_source = label.pose @ own.T_label_source
    return own, transform(np.linalg.inv(T_mesh_source), vertices)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("category", CATEGORIES)
def test_frames_are_rigid_and_their_boxes_hold_the_surface(category, source):
    own, surface = frame(category, source)
    rotation = own.T_label_source[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1)
    assert (np.ptp(surface, axis=0) <= own.extents + 1e-6).all()


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("category", ("bowl", "mug", "box"))
def test_each_source_has_its_own_up(category, source):
    label, _ = specimen(category)
    own, surface = frame(category, source)
    up = own.T_label_source[0, :3]  # the label's X in the source's axes, renamed (z, x, y)
    np.testing.assert_allclose(up, [0, 0, 1] if source == "OmniObject3D" else [1, 0, 0], atol=1e-9)
    middle = (surface.min(axis=0) + surface.max(axis=0)) / 2
    if source == "YCB":
        assert surface[:, 0].min() == pytest.approx(0, abs=1e-6)
        assert 0.001 < np.linalg.norm(middle[1:]) < 0.12
    else:
        np.testing.assert_allclose(middle, 0, atol=1e-6)


def test_tools_of_ycb_lie_flat():
    _, surface = frame("hammer", "YCB")
    assert surface[:, 0].min() == pytest.approx(0, abs=1e-6)
    assert np.argmin(np.ptp(surface, axis=0)) == 0


def test_ycb_turns_objects_by_quarters_or_anyhow():
    headings = []
    for i in range(60):
        own = ycb_frame(f"m{i}")
        headings.append(np.degrees(np.arctan2(own[2, 1], own[1, 1])))
    along = np.abs(np.array(headings) / 90 - np.round(np.array(headings) / 90)) < 1e-6
    assert 0.35 < along.mean() < 0.8
    assert len({round(h) % 360 for h in headings}) > 15
    first, again = (ycb_frame("m0") for _ in range(2))
    np.testing.assert_array_equal(first, again)


@cache
def mug_bounds() -> tuple[PoseLabel, np.ndarray]:
    label, vertices = specimen("mug")
    return label, label_bounds(label, vertices)


def ycb_frame(name: str) -> np.ndarray:
    """`T_label_source` of a mug of this name."""
    return source_label(name, *mug_bounds(), "YCB").T_label_source


def test_objects_are_spread_over_the_sources_for_ever():
    shares = [assigned_source(f"mug_{i:03d}") for i in range(300)]
    assert min(shares.count(source) for source in SOURCES) > 70
    assert shares[:4] == [assigned_source(f"mug_{i:03d}") for i in range(4)]


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("category", CATEGORIES)
def test_groups_leave_the_surfaces_box_where_it_is(category, source):
    label, vertices = specimen(category)
    own, _ = frame(category, source)
    for turn in own.symmetry.rotations:
        back = own.T_label_source[:3, :3] @ turn @ own.T_label_source[:3, :3].T
        bounds = label_bounds(label, vertices)
        again = label_bounds(
            label, transform(label.pose, transform(np.linalg.inv(label.pose), vertices) @ back.T)
        )
        # About an axis of revolution the vertices themselves are only nearly invariant.
        np.testing.assert_allclose(again, bounds, atol=2e-3)


def cloud(label: PoseLabel, name: str) -> LabelledCloud:
    zeros = np.zeros((40, 3), np.float32)
    pose = AT.astype(np.float32)
    return LabelledCloud(zeros, zeros, pose, label.extents, label.symmetry, name, "object")


@pytest.mark.parametrize("source", SOURCES)
def test_errors_in_a_sources_frame(source):
    label = PoseLabel(
        np.zeros(3), np.eye(3), "axial", np.array([0.1, 0.06, 0.06]), SymmetryGroup.about_x()
    )
    bounds = 0.5 * np.stack([-label.extents, label.extents])
    labels = {"o": source_label("o", label, bounds, source)}
    own = labels["o"].T_label_source
    (there,) = with_source_frames([cloud(label, "o/0")], labels)
    np.testing.assert_allclose(there.pose, AT @ own, atol=1e-6)
    # Right up to a turn about the axis of revolution: no error, wherever the source's origin is.
    spun = AT @ compose(rotation_about(np.eye(3)[0], 1.0), np.zeros(3)) @ own
    errors = pose_errors(spun[None], [cloud(label, "o/0")], sources=labels)
    assert errors.rotation[0] == pytest.approx(0, abs=1e-3)
    assert errors.origin[0] == pytest.approx(0, abs=6e-4)
    tilted = AT @ compose(rotation_about(np.eye(3)[2], 0.5), np.array([0.02, 0, 0])) @ own
    errors = pose_errors(tilted[None], [cloud(label, "o/0")], sources=labels)
    assert errors.rotation[0] == pytest.approx(0.5, abs=1e-3)
    assert errors.origin[0] > 0.005
