"""Tapered objects are wider at one end, keep their kind, and carry the label of what they have become."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.poses import invert, transform
from manipose_mj.ppf_jax.data.augmentation.tapering import taperable
from manipose_mj.ppf_jax.data.view_cache import catalogue_clouds, catalogue_subject
from manipose_mj.ppf_jax.data.view_settings import view_setting


def _own(subject):
    corners = subject.triangles.corners.reshape(-1, 3)
    return transform(invert(subject.label.pose), corners)


def _width(own, low, high):
    """Across the symmetry plane, between two shares of the height."""
    share = (own[:, 0] - own[:, 0].min()) / np.ptp(own[:, 0])
    return np.ptp(own[(share >= low) & (share <= high), 2])


@pytest.mark.parametrize("share", [-0.2, 0.1])
@pytest.mark.parametrize("category", ["mug", "cup", "bowl"])
def test_the_upper_end_is_wider_by_so_much_and_the_label_is_the_new_shape_s(category, share):
    plain = catalogue_subject(category, 3, resting=False)
    changed = catalogue_subject(category, 3, resting=False, taper=share)
    own, before = _own(changed), _own(plain)
    assert _width(own, 0.95, 1.0) / _width(before, 0.95, 1.0) == pytest.approx(1 + share, abs=0.02)
    assert _width(own, 0.0, 0.02) / _width(before, 0.0, 0.02) == pytest.approx(1 - share, abs=0.02)
    np.testing.assert_allclose(np.ptp(own, axis=0), changed.label.extents, atol=1e-9)
    np.testing.assert_allclose(own.max(axis=0) + own.min(axis=0), 0.0, atol=1e-9)
    np.testing.assert_array_equal(changed.label.rotation, plain.label.rotation)
    assert changed.label.extents[0] == pytest.approx(plain.label.extents[0])


def test_a_mug_s_wall_stays_upright():
    own = _own(catalogue_subject("mug", 3, resting=False, taper=0.2))
    share = (own[:, 0] - own[:, 0].min()) / np.ptp(own[:, 0])
    ends = [own[share > 0.95, 1], own[share < 0.05, 1]]
    top, base = ((end.min() + end.max()) / 2 for end in ends)
    assert top == pytest.approx(base, abs=0.001)


def test_boxes_and_tools_are_left_as_they_are():
    for category in ("box", "hammer"):
        assert not taperable(catalogue_subject(category, 0, resting=False).label)
        plain, asked = (
            catalogue_subject(category, 0, resting=False, taper=taper) for taper in (0.0, 0.2)
        )
        np.testing.assert_array_equal(plain.triangles.corners, asked.triangles.corners)


@pytest.mark.full
def test_only_training_sees_them_another_one_in_every_file(monkeypatch, tmp_path):
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path))
    monkeypatch.setattr("manipose_mj.ppf_jax.data.view_cache.VIEWS_PER_FILE", 2)
    widths = {}
    for name in ("training", "anywhere"):
        quick = replace(view_setting(name), image_heights=(120,), occluded=0.0)
        clouds = catalogue_clouds("cup", "test", quick, views=4)
        assert [cloud.name for cloud in clouds[:4]] == [f"cup_004/{i}" for i in range(4)]
        widths[name] = [cloud.extents[1] for cloud in clouds[:4]]
    assert len(set(widths["anywhere"])) == 1
    assert widths["training"][0] == widths["training"][1] != widths["training"][2]
