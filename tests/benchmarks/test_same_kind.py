"""Clouds are compared with other scans of the kind in all turns that exchange axes."""

from __future__ import annotations

import importlib

import numpy as np
import trimesh

from manipose_mj.poses import SymmetryGroup

same_kind = importlib.import_module("same_kind")


def test_turns_are_all_24():
    assert len(same_kind.TURNS) == 24
    assert len({turn.tobytes() for turn in same_kind.TURNS}) == 24
    for turn in same_kind.TURNS:
        np.testing.assert_array_equal(turn @ turn.T, np.eye(3))
        assert np.linalg.det(turn) == 1


def test_the_right_turn_of_the_same_shape_is_nearest():
    """Of a shape that no turn leaves as it is, seen stretched, moved and in part."""
    corner = trimesh.util.concatenate([
        trimesh.creation.box((0.10, 0.02, 0.02)),
        trimesh.creation.box((0.02, 0.07, 0.02)).apply_translation((0.04, 0.04, 0)),
        trimesh.creation.box((0.02, 0.02, 0.05)).apply_translation((-0.04, 0, 0.03)),
    ])  # fmt: skip
    scan, seen = (
        np.asarray(trimesh.sample.sample_surface(corner, count, seed=seed)[0])
        for count, seed in ((1200, 0), (250, 1))
    )
    seen = seen[seen[:, 1] > -0.005] * (1.1, 0.9, 1.0) + (0.01, 0.02, -0.01)
    for right in (0, 9, 17):
        turned = seen @ same_kind.TURNS[right].T
        apart = [same_kind.distance(turned @ turn, scan) for turn in same_kind.TURNS]
        assert int(np.argmin(apart)) == right


def test_the_error_of_a_turn_is_the_turn():
    pose, half = np.eye(4), np.diag([1.0, -1.0, -1.0])
    free = SymmetryGroup.identity()
    assert same_kind.turn_error(pose, np.eye(3), pose, free) == 0
    assert same_kind.turn_error(pose, half, pose, free) == np.pi
    assert same_kind.turn_error(pose, half, pose, SymmetryGroup.two_planes()) == 0
