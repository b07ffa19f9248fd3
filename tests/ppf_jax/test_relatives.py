"""What a frame may be mistaken for: never itself, never the same twice, neither up to symmetry."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.poses import rotation_about, rotation_angle
from manipose_mj.ppf_jax.relatives import relatives
from manipose_mj.ppf_jax.symmetry import CommonSymmetry

HALF_TURNS = [rotation_about(axis, np.pi) for axis in np.eye(3)]
MUG, POT, BOX = (
    CommonSymmetry(),
    CommonSymmetry(False, False, True),
    CommonSymmetry(False, True, True),
)
CUP, SAUSAGE = CommonSymmetry(True), CommonSymmetry(True, True)
GROUPS = {MUG: [], POT: HALF_TURNS[:1], BOX: HALF_TURNS}


@pytest.mark.parametrize(
    ("symmetry", "count"), [(MUG, 9), (POT, 4), (BOX, 5), (CUP, 1), (SAUSAGE, 0)]
)
def test_they_are_proper_turns_and_pairwise_different(symmetry, count):
    turns = relatives(symmetry)
    assert turns.shape == (count, 3, 3) and turns.dtype == np.float32
    assert np.allclose(np.linalg.det(turns), 1, atol=1e-5)
    frames = [np.eye(3), *turns.astype(float)]
    for member in [np.eye(3), *GROUPS.get(symmetry, [])]:
        angles = [
            float(rotation_angle(a @ member, b)) for i, a in enumerate(frames) for b in frames[:i]
        ]
        assert not angles or min(angles) > np.radians(40)


def test_a_box_can_have_any_axis_for_any_other():
    x_axes = {tuple(np.abs(turn[:, 0])) for turn in [np.eye(3), *relatives(BOX)]}
    y_axes = {tuple(np.abs(turn[:, 1])) for turn in [np.eye(3), *relatives(BOX)]}
    assert len(x_axes) == len(y_axes) == 3


def test_a_cup_can_be_upside_down():
    assert np.allclose(relatives(CUP)[0][:, 0], [-1, 0, 0], atol=1e-6)
