"""Errors are those of the conventions, of NOCS and of BOP, on cases worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, compose, rotation_about
from manipose_mj.ppf_jax.data.rendering import Subject, cloud_of_view, render_view
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.evaluation.pose_metrics import (
    BOP_TURNS,
    PoseErrors,
    handle_seen,
    most_confident,
    mssd,
    pose_errors,
    summary,
)
from manipose_mj.ppf_jax.points.clouds import LabelledCloud

X, Y, Z = np.eye(3)
AT = compose(rotation_about(np.array([0.6, 0.0, 0.8]), 0.7), np.array([0.1, -0.05, 0.8]))


def seen(
    group: SymmetryGroup,
    *,
    category: str = "object",
    points_label: np.ndarray | None = None,
    extents: tuple[float, float, float] = (0.1, 0.12, 0.08),
) -> LabelledCloud:
    points = np.zeros((40, 3)) if points_label is None else points_label
    placed = (points @ AT[:3, :3].T + AT[:3, 3]).astype(np.float32)
    pose, sides = AT.astype(np.float32), np.array(extents, np.float32)
    return LabelledCloud(placed, np.zeros_like(placed), pose, sides, group, "thing_000/0", category)


def turned(axis: np.ndarray, angle: float, shift: float = 0.0) -> np.ndarray:
    moved = AT.copy()
    moved[:3, :3] = moved[:3, :3] @ rotation_about(axis, angle)
    moved[:3, 3] += shift
    return moved[None]


@pytest.mark.parametrize(
    ("group", "axis", "angle", "requested"),
    [
        (SymmetryGroup.identity(), Z, 0.3, 0.3),
        (SymmetryGroup.about_x(), X, 2.0, 0.0),
        (SymmetryGroup.about_x(), Z, 3.0, 3.0),
        (SymmetryGroup.about_x(ends_alike=True), Z, 3.0, np.pi - 3.0),
        (SymmetryGroup.two_planes(), X, 3.0, np.pi - 3.0),
        (SymmetryGroup.three_planes(), Y, 3.0, np.pi - 3.0),
    ],
)
def test_rotation_is_the_least_over_the_group(group, axis, angle, requested):
    errors = pose_errors(turned(axis, angle, 0.01), [seen(group)])
    assert errors.rotation[0] == pytest.approx(requested, abs=1e-3)
    assert errors.origin[0] == pytest.approx(0.01 * np.sqrt(3), abs=1e-6)
    assert np.isnan(errors.mssd[0])


def test_a_print_counts_beside_the_shape():
    cloud, half = seen(SymmetryGroup.three_planes()), turned(Z, np.pi)
    errors = pose_errors(half, [cloud], textured={"thing_000": SymmetryGroup.two_planes()})
    assert errors.rotation[0] == pytest.approx(0.0, abs=1e-3)
    assert errors.textured_rotation[0] == pytest.approx(np.pi, abs=1e-3)
    alone = pose_errors(half, [cloud])
    assert alone.textured_rotation[0] == alone.rotation[0]


def handle_points(count: int) -> np.ndarray:
    """A body of 8 cm around the axis at y = -2 cm, and `count` points on a handle beyond it."""
    angle = np.linspace(0, 2 * np.pi, 200 - count)
    body = np.stack([0 * angle, -0.02 + 0.04 * np.cos(angle), 0.04 * np.sin(angle)], axis=1)
    return np.concatenate([body, np.tile([[0.0, 0.05, 0.0]], (count, 1))])


@pytest.mark.parametrize(("count", "shown"), [(0, False), (4, False), (6, True), (40, True)])
def test_a_handle_is_seen_where_points_are_on_it(count, shown):
    cloud = seen(SymmetryGroup.identity(), category="mug", points_label=handle_points(count))
    assert handle_seen(cloud) is shown
    errors = pose_errors(turned(X, 2.0), [cloud])
    assert errors.rotation[0] == pytest.approx(2.0, abs=1e-3)
    assert errors.nocs_rotation[0] == pytest.approx(2.0 if shown else 0.0, abs=1e-3)


def test_nocs_forgives_mugs_only():
    cloud = seen(SymmetryGroup.identity(), category="teapot", points_label=handle_points(0))
    assert pose_errors(turned(X, 2.0), [cloud]).nocs_rotation[0] == pytest.approx(2.0, abs=1e-3)


def test_a_rendered_mugs_handle_is_seen_from_its_side_only():
    specimen = catalogue.generate("mug", 4)
    subject = Subject.of_mesh(
        specimen.bodies[0].surface(), specimen.label, name="m", category="mug"
    )
    agree = []
    for seed in range(20):
        view = render_view(subject, view_setting("anywhere"), np.random.default_rng(seed))
        points, normals = cloud_of_view(view, np.random.default_rng(seed))
        pose = view.T_camera_mesh @ subject.label.pose
        extents, group = subject.label.extents, subject.label.symmetry
        cloud = LabelledCloud(points, normals, pose, extents, group, "m/0", "mug")
        # What the exact depth shows of the handle, away from the threshold.
        exact = view.exact.depth[..., None] * np.concatenate(
            [view.intrinsics.slopes(), np.ones((*view.exact.depth.shape, 1))], axis=-1
        )
        label = (exact[view.exact.item == 0] - pose[:3, 3]) @ pose[:3, :3]
        share = (label[:, 1] > -extents[1] / 2 + extents[2] + 0.006).mean()
        if share < 0.002 or share > 0.03:
            agree.append(handle_seen(cloud) == (share > 0.03))
    assert len(agree) > 10 and np.mean(agree) > 0.9


def test_mssd_is_that_of_the_farthest_vertex():
    hull = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.2, 0]])
    identity, about = SymmetryGroup.identity(), SymmetryGroup.about_x()
    half = turned(X, np.pi)[0]
    assert mssd(half, AT, identity.rotations, hull) == pytest.approx(0.4)
    assert mssd(half, AT, about.sampled(BOP_TURNS), hull) == pytest.approx(0, abs=0.2 * np.pi / 315)
    errors = pose_errors(half[None], [seen(identity)], hulls={"thing_000": hull})
    assert errors.mssd[0] == pytest.approx(0.4, abs=1e-6)


def test_the_summary_counts_in_degrees_and_centimetres():
    degrees = np.array([1.0, 4.0, 8.0, 170.0])
    origin = np.array([0.01, 0.03, 0.015, 0.02])
    rotation = np.deg2rad(degrees)
    nocs, mssd = rotation * [1, 1, 1, 0], np.full(4, 0.05)
    row = summary(PoseErrors(origin, rotation, 2 * rotation, nocs, mssd))
    assert row["n"] == 4 and row["flipped"] == 0.25
    assert row["deg_mean"] == pytest.approx(45.75) and row["deg_median"] == pytest.approx(6.0)
    assert row["origin_cm_mean"] == pytest.approx(1.875)
    assert row["textured_deg_mean"] == pytest.approx(91.5)
    assert row["textured_deg_median"] == pytest.approx(12.0)
    assert row["nocs_deg_mean"] == pytest.approx(13 / 4)
    assert row["mssd_cm_mean"] == pytest.approx(5.0)
    recalls = [row[f"recall_{name}"] for name in ("5deg_2cm", "5deg_5cm", "10deg_2cm", "10deg_5cm")]
    assert recalls == [0.25, 0.5, 0.5, 0.75]


def test_the_most_confident_are_kept_in_order():
    kept = most_confident(np.array([0.1, 0.9, 0.5, 0.5, 0.3]), 0.6)
    assert kept.tolist() == [False, True, True, True, False]


@pytest.mark.usefixtures("wrong_arrays")
def test_estimates_that_are_no_poses_are_named():
    cloud = seen(SymmetryGroup.identity())
    with pytest.raises(InputError, match=r"expected \(1, 4, 4\)"):
        pose_errors(np.eye(4), [cloud])
    with pytest.raises(InputError, match="thing_000/0 is not finite"):
        pose_errors(np.full((1, 4, 4), np.nan), [cloud])
    empty = np.empty(0)
    with pytest.raises(InputError, match="no estimates"):
        summary(PoseErrors(empty, empty, empty, empty, empty))
