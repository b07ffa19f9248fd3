"""The symmetry of shape and print: what of the shape's group leaves the colours in place."""

import numpy as np
import pytest
import trimesh

from asset_pipeline.labelling.print_symmetry import print_symmetry
from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup

RED, WHITE = np.array([0.8, 0.1, 0.1]), np.array([0.95, 0.95, 0.95])
BOX = SurfaceCloud.of(trimesh.creation.box(extents=[0.1, 0.06, 0.04]))
TIN = SurfaceCloud.of(trimesh.creation.cylinder(0.03, 0.1).apply_transform(
    trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
))  # fmt: skip


def _label(group: SymmetryGroup) -> PoseLabel:
    return PoseLabel(np.zeros(3), np.eye(3), "mirror", np.array([0.1, 0.06, 0.06]), group)


def _painted(cloud: SurfaceCloud, red: np.ndarray) -> np.ndarray:
    return np.where(red[:, None], RED, WHITE)


@pytest.mark.parametrize(
    ("red", "members"),
    [
        (BOX.points[:, 2] > 9, 4),  # plain
        (np.abs(BOX.points[:, 0]) > 0.03, 4),  # both ends
        (BOX.points[:, 2] > 0.01, 2),  # the top: half a turn about Z leaves it
        ((BOX.points[:, 0] > 0.01) & (BOX.points[:, 1] > 0) & (BOX.points[:, 2] > 0), 1),
    ],
)
def test_a_boxs_print_keeps_some_of_its_half_turns(red, members):
    group = print_symmetry(BOX, _painted(BOX, red), _label(SymmetryGroup.three_planes()))
    assert len(group.rotations) == members and not group.axial


@pytest.mark.parametrize(
    ("red", "axial", "members"),
    [
        (np.abs(TIN.points[:, 0]) > 0.03, True, 2),  # a band at either end
        (TIN.points[:, 0] > 0.02, True, 1),  # a lid
        (TIN.points[:, 1] > 0, False, 1),  # one side
        (TIN.points[:, 1] * TIN.points[:, 2] > 0, False, 2),  # the same emblem on opposite sides
    ],
)
def test_a_tins_print_may_end_its_turns_or_tell_its_ends_apart(red, axial, members):
    label = _label(SymmetryGroup.about_x(ends_alike=True))
    group = print_symmetry(TIN, _painted(TIN, red), label)
    assert (group.axial, len(group.rotations)) == (axial, members)


def test_an_unread_print_leaves_nothing_but_turns_about_an_axis_of_revolution():
    tin = print_symmetry(TIN, None, _label(SymmetryGroup.about_x(ends_alike=True)))
    assert tin.axial and len(tin.rotations) == 1
    assert len(print_symmetry(BOX, None, _label(SymmetryGroup.three_planes())).rotations) == 1
