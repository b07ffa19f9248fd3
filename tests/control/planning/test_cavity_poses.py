"""What an object takes up in a cavity is what its shape does, where the box around it would not fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.perception.pose_sources import make_perception
from manipose_mj.control.planning.cavity_places import CAVITY_MARGIN, poses_in_cavity
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


def test_what_an_uncertain_object_may_fit_as_well_is_told_apart(estimate, can):
    drawer = estimate.parts["middle_drawer"]
    opening = drawer.joint.range[1]
    assert drawer.cavity is not None
    # Room for the can to lie, and 2 mm too little for it to stand.
    height = can.label.extents[0] + CAVITY_MARGIN[2] - 0.002
    part = replace(drawer, cavity=replace(drawer.cavity, extents=np.array([0.4, 0.4, height])))

    def standing(poses):
        return [abs(pose[2, 0]) > 0.9 for pose in poses]

    unsure = replace(can, uncertainty=0.003)
    assert not any(standing(poses_in_cavity(unsure, part, opening, estimate)))
    as_well = standing(poses_in_cavity(unsure, part, opening, estimate, others=True))
    assert as_well and all(as_well)
    assert not poses_in_cavity(can, part, opening, estimate, others=True)
    # Where it fits in no other way, these are all there are.
    tall = replace(part, cavity=replace(part.cavity, extents=np.array([0.09, 0.09, height])))
    assert all(standing(poses_in_cavity(unsure, tall, opening, estimate)))
    assert not poses_in_cavity(unsure, tall, opening, estimate, others=True)
