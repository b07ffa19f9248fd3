"""Objects made of two keep what names their frames; their clouds are cached and reproducible."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from manipose_mj.assets import catalogue
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.data.augmentation.part_swap import (
    CUT,
    LENGTHS,
    Whole,
    common,
    part_swappable,
    part_swapped,
)
from manipose_mj.ppf_jax.data.part_swap_clouds import CATEGORY, part_swap_clouds, part_swap_subject
from manipose_mj.ppf_jax.data.view_settings import view_setting


def _whole(category, index=0):
    specimen = catalogue.generate(category, index)
    return Whole(specimen.bodies[0].surface(), specimen.label)


def test_a_tool_is_the_grip_of_one_and_the_head_of_another_joined_at_the_origin():
    grip, head = _whole("screwdriver"), _whole("spoon")
    made = part_swapped(grip, head, np.random.default_rng(0))
    own, lower, upper = (np.asarray(each.own().vertices) for each in (made, grip, head))
    assert own[:, 0].min() == pytest.approx(lower[:, 0].min())
    np.testing.assert_allclose(
        np.ptp(own[own[:, 0] < -1e-6], axis=0),
        np.ptp(lower[lower[:, 0] < -1e-6], axis=0),
        rtol=0.05,
    )
    scale = own[:, 0].max() / upper[:, 0].max()
    assert 0.75 < scale < 1.3
    bowl = own[:, 0] > 0.5 * own[:, 0].max()
    assert np.ptp(own[bowl, 2]) == pytest.approx(scale * np.ptp(upper[:, 2]), rel=0.02)
    np.testing.assert_allclose(made.label.origin, 0.0)
    np.testing.assert_allclose(made.label.extents, np.ptp(own, axis=0))
    assert made.label.object_type == "functional" and not made.label.symmetry.axial


@pytest.mark.parametrize(("lower", "upper"), [("bottle", "cup"), ("apple", "vase")])
def test_round_objects_meet_at_one_width_and_stay_round(lower, upper):
    below = _whole(lower).own()
    for seed in range(4):
        made = part_swapped(_whole(lower), _whole(upper), np.random.default_rng(seed))
        assert made.label.symmetry.axial and len(made.label.symmetry.rotations) == 1
        own = made.own()
        np.testing.assert_allclose(np.asarray(own.bounds).sum(axis=0), 0.0, atol=1e-9)
        assert made.label.extents[1] == pytest.approx(made.label.extents[2], rel=0.02)
        cut = np.random.default_rng(seed).uniform(*CUT) * np.ptp(below.bounds[:, 0])
        sides = [_radius(own, own.bounds[0, 0] + cut + side) for side in (-2e-4, 2e-4)]
        assert sides[0] == pytest.approx(_radius(below, below.bounds[0, 0] + cut), rel=0.02)
        assert sides[1] == pytest.approx(sides[0], rel=0.05)


def _radius(own, height):
    lines = trimesh.intersections.mesh_plane(own, [1.0, 0.0, 0.0], [height, 0.0, 0.0])
    return np.hypot(lines[..., 1], lines[..., 2]).max()


def test_ends_that_are_alike_say_nothing_of_up_and_are_not_used():
    assert not part_swappable(_whole("sausage").label)
    assert not part_swappable(_whole("box").label)
    assert all(part_swappable(_whole(name).label) for name in ("cup", "mug", "hammer", "pot"))


def test_what_is_common_to_two_symmetries():
    one, two, round_ = (
        SymmetryGroup.identity(),
        SymmetryGroup.two_planes(),
        SymmetryGroup.about_x(),
    )
    assert common(round_, round_).axial
    assert len(common(two, round_).rotations) == 2 and not common(round_, two).axial
    assert len(common(one, two).rotations) == 1
    assert len(common(two, two).rotations) == 2


def test_what_would_be_far_too_large_is_not_made():
    lower, upper = _whole("cup"), _whole("bottle")
    huge = replace(lower.label, origin=lower.label.origin * 20, extents=lower.label.extents * 20)
    mesh = lower.mesh.copy()
    mesh.apply_scale(20)
    assert np.ptp(mesh.bounds, axis=0).max() > LENGTHS[1]
    assert all(
        part_swapped(Whole(mesh, huge), upper, np.random.default_rng(seed)) is None
        for seed in range(5)
    )


def test_clouds_are_the_same_again_and_know_their_label(monkeypatch, tmp_path):
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path))
    monkeypatch.setattr("manipose_mj.ppf_jax.data.part_swap_clouds.VIEWS_PER_FILE", 2)
    donors, setting = ("fork", "knife", "spoon"), view_setting("training")
    clouds = part_swap_clouds(donors, 2, setting)
    assert [cloud.name for cloud in clouds] == [
        f"{CATEGORY}_{i:05d}/{j}" for i in (0, 1) for j in (0, 1)
    ]
    files = sorted(tmp_path.rglob("*.npz"))
    stamps = [path.stat().st_mtime_ns for path in files]
    again = part_swap_clouds(donors[::-1], 2, setting)
    assert [path.stat().st_mtime_ns for path in files] == stamps
    for cloud, other in zip(clouds, again, strict=True):
        np.testing.assert_array_equal(cloud.points, other.points)
    subject = part_swap_subject(donors, 1)
    np.testing.assert_allclose(clouds[2].extents, subject.label.extents, rtol=1e-6)
    assert not np.array_equal(clouds[0].extents, clouds[2].extents)
    # Another set of donors makes other objects, in other files.
    part_swap_clouds(donors[:2], 1, setting)
    assert len(list(tmp_path.rglob("*.npz"))) == len(files) + 1


def test_what_cannot_be_made_of_two_is_said():
    with pytest.raises(InputError, match="at least two categories"):
        part_swap_clouds(["cup"], 1, view_setting("training"))
    with pytest.raises(InputError, match="at least two categories"):
        part_swap_clouds(["sausage", "tape", "cup"], 1, view_setting("training"))
    with pytest.raises(InputError, match="resting poses"):
        part_swap_clouds(["cup", "bowl"], 1, view_setting("tasks"))
