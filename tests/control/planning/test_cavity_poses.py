"""What an object takes up in a cavity is what its shape does, where the box around it would not fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.perception.pose_sources import make_perception
from manipose_mj.control.planning.cavity_places import poses_in_cavity
from manipose_mj.control.planning.table_places import resting_rotation


@pytest.fixture(scope="module")
def estimate(environment):
    perception = make_perception("oracle", environment.task, environment.physics)
    perception.reset(0)
    return perception.observe()


@pytest.fixture(scope="module")
def can(estimate):
    return next(iter(estimate.objects.values()))


def test_the_corners_of_an_object_span_it(estimate, can):
    corners = can.corners(estimate.scene)
    np.testing.assert_allclose(np.ptp(corners, axis=0), can.label.extents, atol=0.004)
    np.testing.assert_allclose(
        (corners.min(axis=0) + corners.max(axis=0)) / 2, can.label.center, atol=0.004
    )


def test_a_box_too_large_for_the_cavity_gives_way_to_the_shape(estimate, can):
    part = estimate.parts["middle_drawer"]
    assert part.cavity is not None
    # A label that says the can is thicker than it is, as the box around a tilted vase does.
    thick = replace(can, label=replace(can.label, extents=part.cavity.extents[2] * np.ones(3)))
    lying = [r for r in can.rests if abs((resting_rotation(can, r, 0.0))[2, 0]) < 0.5]
    assert lying, "the can lies on its side"
    assert not poses_in_cavity(thick, part, part.joint.range[1])
    found = poses_in_cavity(thick, part, part.joint.range[1], estimate)
    assert found
    carrier = part.base_pose
    for pose in found:
        down = carrier[:3, :3].T @ pose[:3, :3]
        assert abs(down[2, 0]) < 0.5
