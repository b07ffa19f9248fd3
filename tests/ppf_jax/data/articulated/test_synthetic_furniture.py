"""Synthetic furniture: what its labels say is what is there."""

from __future__ import annotations

import numpy as np
import pytest

from asset_pipeline.procedural.synthetic_furniture.layout import STYLES
from manipose_mj.poses import invert, transform
from manipose_mj.ppf_jax.data.articulated.cache import furniture_names
from manipose_mj.ppf_jax.data.articulated.clouds import MAX_PARTS
from manipose_mj.ppf_jax.data.articulated.subject import SYNTHETIC, synthetic_furniture

COUNT = len(STYLES) + 3


@pytest.fixture(scope="module")
def pieces():
    return [synthetic_furniture(i) for i in range(COUNT)]


@pytest.mark.full
def test_they_are_the_same_again(pieces):
    again = synthetic_furniture(4)
    np.testing.assert_array_equal(again.base.corners, pieces[4].base.corners)
    for one, other in zip(again.joints, pieces[4].joints, strict=True):
        np.testing.assert_array_equal(one.handle, other.handle)
    assert len({piece.name for piece in pieces}) == COUNT


def test_they_are_large_and_various(pieces):
    heights = np.array([piece.label.extents[0] for piece in pieces])
    assert heights.max() > 1.4 and heights.min() > 0.3 and heights.max() < 2.9
    joints = [joint for piece in pieces for joint in piece.joints]
    level = [j for j in joints if j.hinge and abs(j.axis[1]) > 0.9]
    assert len(joints) < COUNT * MAX_PARTS and level
    assert any(not j.hinge for j in joints) and any(j.hinge and j.axis[2] > 0.9 for j in joints)
    for piece in pieces:
        assert 1 <= len(piece.joints) <= MAX_PARTS
        assert piece.base.corners[..., 2].min() == pytest.approx(0.0, abs=1e-6)


def test_handles_are_on_their_parts_and_before_the_front(pieces):
    for piece in pieces:
        for part, joint in zip(piece.parts, piece.joints, strict=True):
            corners = part.corners.reshape(-1, 3)
            local = transform(invert(joint.handle), corners)
            own = np.all(np.abs(local) < joint.handle_extents / 2 + 1e-6, axis=1)
            assert own.any(), (piece.name, joint.name)
            # Its box is about as long as what is in it, and sticks out farther than the part's front.
            assert np.ptp(local[own, 0]) > 0.5 * joint.handle_extents[0], (piece.name, joint.name)
            off = np.linalg.norm(corners - joint.handle[:3, 3], axis=1)
            rest = corners[off > 0.5 * joint.handle_extents[0] + 0.05]
            assert joint.handle[0, 3] < rest[:, 0].min(), (piece.name, joint.name)
            np.testing.assert_allclose(joint.handle[:3, 1], [-1.0, 0.0, 0.0], atol=1e-9)
            # Of X's two signs: up; of a level one, with Z up.
            assert joint.handle[2, 0] + joint.handle[2, 2] > 0.99
            low, high = corners.min(axis=0) - 1e-6, corners.max(axis=0) + 1e-6
            assert (low <= joint.handle[:3, 3]).all() and (joint.handle[:3, 3] <= high).all()


def test_parts_open_away_from_the_body_without_turning_through_it(pieces):
    for piece in pieces:
        for part, joint in zip(piece.parts, piece.joints, strict=True):
            little = joint.motion(0.1 * joint.travel) @ joint.handle
            assert little[0, 3] < joint.handle[0, 3] - 0.005, (piece.name, joint.name)
            if joint.hinge:
                # At the far edge of what it turns.
                reach = np.linalg.norm(np.cross(joint.handle[:3, 3] - joint.origin, joint.axis))
                across = np.ptp(part.corners.reshape(-1, 3), axis=0)
                side = across[1] if abs(joint.axis[2]) > 0.9 else across[2]
                assert 0.45 * side < reach < 1.2 * side, (piece.name, joint.name)


def test_they_are_asked_for_by_number():
    names = furniture_names("train", 1, synthetic=3)
    assert [name for name in names if name[0] == SYNTHETIC] == [(SYNTHETIC, i) for i in range(3)]
    assert not [name for name in furniture_names("test") if name[0] == SYNTHETIC]
