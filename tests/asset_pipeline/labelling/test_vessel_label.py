"""Labels of vessels with handles: Y is at the handle, however small, and no handle is overlooked."""

import numpy as np
import pytest
import trimesh

from asset_pipeline.labelling.scan_label import scan_label
from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.vessel_shape import vessel_shape
from manipose_mj.poses import rotation_about

UP = np.array([0.0, 0.0, 1.0])
TURN = rotation_about(UP, 0.7)
LEAN = rotation_about(np.array([0.6, -0.8, 0.0]), np.deg2rad(6)) @ TURN


def _cup(*handles: tuple[float, float]) -> trimesh.Trimesh:
    """Handles by their direction [deg] and their reach beyond the wall [m]."""
    body = trimesh.creation.cylinder(0.04, 0.09, sections=96)
    lugs = []
    for heading, reach in handles:
        lug = trimesh.creation.box(bounds=[[0.037, -0.004, -0.012], [0.04 + reach, 0.004, 0.012]])
        turn = trimesh.transformations.rotation_matrix(np.deg2rad(heading), UP)
        lugs.append(lug.apply_transform(turn))
    inside = trimesh.creation.cylinder(0.037, 0.09, sections=96).apply_translation([0, 0, 0.004])
    hollow = trimesh.boolean.difference([body, inside])
    cup = trimesh.util.concatenate([hollow, *lugs])
    assert isinstance(cup, trimesh.Trimesh)
    vertices, faces = trimesh.remesh.subdivide_to_size(cup.vertices, cup.faces, 0.005)[:2]
    noise = np.random.default_rng(0).normal(0, 0.0005, vertices.shape)
    return trimesh.Trimesh(vertices @ LEAN.T + noise, faces, process=False)


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.rad2deg(np.arccos(np.clip(a @ b, -1, 1))))


@pytest.mark.sample(2)
@pytest.mark.parametrize("told", ["axial", "mirror"])
@pytest.mark.parametrize("reach", [0.008, 0.03])
def test_y_is_at_the_handle_whatever_type_was_told(told, reach):
    label, quality = scan_label(_cup((0, reach)), told, UP, textured=False)
    assert label.object_type == "mirror" and not label.symmetry.axial
    assert len(label.symmetry.rotations) == 1
    assert _angle(label.rotation[:, 0], LEAN @ UP) < 0.3
    assert _angle(label.rotation[:, 1], LEAN @ [1, 0, 0]) < 1.5
    assert quality.confidence > 0.8


def test_two_handles_are_half_a_turn_apart_or_face_both_ways():
    pot, _ = scan_label(_cup((0, 0.03), (180, 0.03)), "mirror", UP)
    assert len(pot.symmetry.rotations) == 2
    assert abs(pot.rotation[:, 1] @ LEAN @ [1, 0, 0]) > np.cos(np.deg2rad(1.5))
    corner, _ = scan_label(_cup((40, 0.03), (-40, 0.03)), "mirror", UP)
    assert len(corner.symmetry.rotations) == 1
    assert _angle(corner.rotation[:, 1], LEAN @ [1, 0, 0]) < 1.5


def test_a_cup_without_a_handle_has_no_parts_and_a_slab_no_body():
    cup = vessel_shape(SurfaceCloud.of(_cup()), UP)
    assert cup is not None and cup.parts == ()
    assert _angle(cup.axis, LEAN @ UP) < 0.3
    slab = trimesh.creation.box(
        extents=[0.1, 0.15, 0.015]
    )  # a notebook: flat sides turn onto themselves
    assert vessel_shape(SurfaceCloud.of(slab), UP) is None
