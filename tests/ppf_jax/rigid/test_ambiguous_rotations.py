"""What a frame may be mistaken for: never itself, never the same twice, neither up to symmetry."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.poses import rotation_about, rotation_angle
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry
from manipose_mj.ppf_jax.rigid.ambiguous_rotations import ambiguous_rotations

HALF_TURNS = [rotation_about(axis, np.pi) for axis in np.eye(3)]
MUG, POT, BOX = (
    CommonSymmetry(),
    CommonSymmetry(False, False, True),
    CommonSymmetry(False, True, True),
)
MIXED = CommonSymmetry(boxes=True)
CUP, SAUSAGE = CommonSymmetry(True), CommonSymmetry(True, True)
GROUPS = {MUG: [], POT: HALF_TURNS[:1], BOX: HALF_TURNS}


@pytest.mark.parametrize(
    ("symmetry", "count"), [(MUG, 9), (MIXED, 27), (POT, 4), (BOX, 5), (CUP, 1), (SAUSAGE, 0)]
)
def test_they_are_proper_turns_and_pairwise_different(symmetry, count):
    turns = ambiguous_rotations(symmetry)
    assert turns.shape == (count, 3, 3) and turns.dtype == np.float32
    assert np.allclose(np.linalg.det(turns), 1, atol=1e-5)
    frames = [np.eye(3), *turns.astype(float)]
    for member in [np.eye(3), *GROUPS.get(symmetry, [])]:
        angles = [
            float(rotation_angle(a @ member, b)) for i, a in enumerate(frames) for b in frames[:i]
        ]
        assert not angles or min(angles) > np.radians(40)


@pytest.mark.parametrize("symmetry", [BOX, MIXED])
def test_a_box_can_have_any_axis_for_any_other(symmetry):
    frames = [np.eye(3), *ambiguous_rotations(symmetry)]
    orders = {tuple(np.abs(f).argmax(axis=0)) for f in frames if np.abs(f).max(axis=0).min() > 0.9}
    assert len(orders) == 6


def test_among_boxes_all_turns_of_a_cube_are_tried():
    frames = [np.eye(3), *ambiguous_rotations(MIXED)]
    cube = {
        tuple(f.round().astype(int).ravel()) for f in frames if np.abs(f).max(axis=0).min() > 0.9
    }
    assert len(cube) == 24


def test_a_cup_can_be_upside_down():
    assert np.allclose(ambiguous_rotations(CUP)[0][:, 0], [-1, 0, 0], atol=1e-6)
