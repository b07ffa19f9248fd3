"""Closed surfaces: bodies that reach into one another, cavities, and pieces inside out."""

import numpy as np
import pytest
import trimesh

from asset_pipeline.geometry.convexify import convexify, fidelity
from asset_pipeline.geometry.repair import closed, turn_outwards


def cube(*place):
    box = trimesh.creation.box((1, 1, 1))
    box.apply_translation(place)
    return box


def joined(*bodies):
    return trimesh.util.concatenate(bodies)


def test_bodies_that_overlap_become_one():
    solid = closed(joined(cube(0, 0, 0), cube(0.5, 0.2, 0)))
    assert solid is not None
    assert solid.body_count == 1
    assert solid.volume == pytest.approx(2 - 0.5 * 0.8)


def test_bodies_apart_stay_as_they_are():
    apart = joined(cube(0, 0, 0), cube(3, 0, 0))
    solid = closed(apart)
    assert solid is not None
    assert solid.body_count == 2
    np.testing.assert_array_equal(
        np.unique(solid.vertices, axis=0), np.unique(apart.vertices, axis=0)
    )


def test_cavity_stays_hollow_where_bodies_overlap():
    void = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    volume = void.volume
    void.invert()
    solid = closed(joined(cube(0, 0, 0), cube(0.5, 0.2, 0), void))
    assert solid is not None
    # The second cube reaches through the cavity's wall and fills what it covers.
    assert 1.6 - volume < solid.volume < 1.6


@pytest.mark.parametrize("place", [(3, 0, 0), (0.5, 0.2, 0)], ids=["apart", "overlapping"])
@pytest.mark.parametrize("shift", [0, 40], ids=["near the origin", "far from it"])
def test_a_piece_inside_out_is_turned_and_a_cavity_is_not(place, shift):
    void = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    void.invert()
    right = joined(cube(0, 0, 0), void, cube(*place))
    wrong = right.copy()
    wrong.faces[-12:] = wrong.faces[-12:, ::-1]
    for mesh in (right, wrong):
        mesh.apply_translation([shift, 0, 0])
    assert turn_outwards(right.copy()) == 0
    assert turn_outwards(wrong) == 12
    np.testing.assert_array_equal(wrong.faces, right.faces)


def test_a_larger_piece_inside_out_takes_the_smaller_with_it_no_more():
    mesh = joined(cube(0, 0, 0), cube(3, 0, 0))
    mesh.vertices[:8] *= 2
    mesh.faces[:12] = mesh.faces[:12, ::-1]
    assert turn_outwards(mesh) == 12
    assert mesh.volume == pytest.approx(8 + 1)


def test_what_is_all_inside_out_is_turned_with_its_cavity():
    void = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    void.invert()
    hollow = joined(cube(0, 0, 0), void, cube(3, 0, 0))
    volume = hollow.volume
    hollow.invert()
    assert turn_outwards(hollow) == len(hollow.faces)
    assert hollow.volume == pytest.approx(volume)


@pytest.mark.full
def test_overlapping_bodies_decompose_in_seconds(tmp_path):
    body = trimesh.creation.cylinder(0.045, 0.11, sections=64)
    handle = trimesh.creation.torus(0.03, 0.006)
    handle.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    handle.apply_translation([0.055, 0, 0])
    mug = joined(body, handle)
    parts = convexify(mug, cache=tmp_path)
    assert 2 <= len(parts) <= 32
    assert fidelity(mug, parts).gap < 0.004
