"""Which turns about the way out leave a handle as it is."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from asset_pipeline.labelling.handle_label import ROUND, handle_label

OUT = np.array([1.0, 0.0, 0.0])


def round_knob(diameter: float) -> trimesh.Trimesh:
    turned = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    return trimesh.creation.cylinder(diameter / 2, 0.016, sections=48, transform=turned)


@pytest.mark.parametrize(
    ("mesh", "turns"),
    [
        (round_knob(0.013), ROUND),
        (round_knob(0.030), ROUND),
        (trimesh.creation.box((0.016, 0.028, 0.028)), 4),
        (trimesh.creation.box((0.012, 0.25, 0.012)), 2),
        (trimesh.creation.box((0.016, 0.024, 0.034)), 2),
    ],
    ids=["small knob", "knob", "square knob", "bar", "oblong knob"],
)
def test_a_handle_has_as_many_turns_as_leave_its_shape(mesh, turns):
    group = handle_label(mesh, OUT).symmetry
    assert len(group.rotations) == turns
    np.testing.assert_allclose(group.rotations[0], np.eye(3))
    for turn in group.rotations:
        np.testing.assert_allclose(turn @ [0, 1, 0], [0, 1, 0], atol=1e-12)


def test_a_wedge_has_no_turns():
    corners = [[0, y, z] for y in (-0.1, 0.1) for z in (0, 0.03)]
    corners += [[0.02, y, 0] for y in (-0.1, 0.1)]
    wedge = trimesh.Trimesh(corners).convex_hull
    assert len(handle_label(wedge, OUT).symmetry.rotations) == 1
