"""Mass, centre and inertia against the closed forms."""

import logging

import numpy as np
import pytest
import trimesh

from asset_pipeline.geometry.mass import (
    combine,
    second_moments,
    shape_mass_properties,
    shell_mass_properties,
    solid_mass_properties,
)
from manipose_mj.assets.geometry import Shape
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, rotation_about

OFFSET = np.array([0.3, -0.2, 0.1])


def _moved(mesh, offset=OFFSET):
    mesh.apply_translation(offset)
    return mesh


def test_solid_box():
    a, b, c = 0.1, 0.2, 0.3
    found = solid_mass_properties(_moved(trimesh.creation.box((a, b, c))), 2.0)
    assert found.mass == 2.0
    np.testing.assert_allclose(found.center_of_mass, OFFSET, atol=1e-12)
    expected = 2 / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    np.testing.assert_allclose(found.inertia, expected, atol=1e-12)


def test_hollow_sphere_and_hollow_box():
    radius = 0.05
    sphere = _moved(trimesh.creation.icosphere(subdivisions=4, radius=radius))
    found = shell_mass_properties(sphere, 0.4)
    np.testing.assert_allclose(found.center_of_mass, OFFSET, atol=1e-9)
    np.testing.assert_allclose(
        found.inertia, 2 / 3 * 0.4 * radius**2 * np.eye(3), rtol=5e-3, atol=1e-9
    )
    # Of a hollow cube of side s: 5/18 m s^2 about every axis through its middle.
    cube = shell_mass_properties(_moved(trimesh.creation.box((0.2, 0.2, 0.2))), 3.0)
    np.testing.assert_allclose(cube.inertia, 5 / 18 * 3 * 0.2**2 * np.eye(3), atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "size", "volume", "diagonal"),
    [
        ("sphere", (0.1,), 4 / 3 * np.pi * 1e-3, 2 / 5 * 0.01 * np.ones(3)),
        ("box", (0.1, 0.2, 0.3), 8 * 6e-3, np.array([0.13, 0.10, 0.05]) / 3),
        ("cylinder", (0.1, 0.2), np.pi * 4e-3, np.array([0.01 / 4 + 0.04 / 3, 0.01 / 4 + 0.04 / 3, 0.005])),
        ("ellipsoid", (0.1, 0.2, 0.3), 4 / 3 * np.pi * 6e-3, np.array([0.13, 0.10, 0.05]) / 5),
    ],
)  # fmt: skip
def test_primitives(kind, size, volume, diagonal):
    """In the closed form, turned and moved, and the same as the mesh of a primitive."""
    turn = rotation_about(np.array([0.6, 0.0, 0.8]), 0.7)
    shape = Shape(kind, size, compose(turn, OFFSET))
    found = shape_mass_properties([shape], 500.0)
    assert found.mass == pytest.approx(500 * volume)
    np.testing.assert_allclose(found.center_of_mass, OFFSET, atol=1e-12)
    inertia = turn @ np.diag(diagonal * found.mass) @ turn.T
    np.testing.assert_allclose(found.inertia, inertia, rtol=1e-9, atol=1e-12)
    meshed = solid_mass_properties(shape.surface(sections=128), found.mass)
    np.testing.assert_allclose(meshed.inertia, inertia, rtol=0.03, atol=0.02 * inertia.max())


def test_capsule_is_a_cylinder_and_two_half_balls():
    shape = Shape("capsule", (0.1, 0.2))
    found = shape_mass_properties([shape], 1000.0)
    assert found.mass == pytest.approx(1000 * np.pi * (4e-3 + 4 / 3 * 1e-3))
    meshed = solid_mass_properties(shape.surface(sections=96), found.mass)
    np.testing.assert_allclose(found.inertia, meshed.inertia, rtol=4e-3, atol=1e-9)


def test_parts_make_the_whole():
    """Two half boxes of one density are the box; of two densities the centre moves."""
    halves = [
        Shape("box", (0.1, 0.1, 0.1), compose(np.eye(3), np.array([x, 0.0, 0.0])))
        for x in (-0.1, 0.1)
    ]
    whole = shape_mass_properties([Shape("box", (0.2, 0.1, 0.1))], 100.0)
    joined = shape_mass_properties(halves, 100.0)
    assert joined.mass == pytest.approx(whole.mass)
    np.testing.assert_allclose(joined.inertia, whole.inertia, atol=1e-15)
    uneven = shape_mass_properties(halves, [100.0, 300.0])
    np.testing.assert_allclose(uneven.center_of_mass, [0.05, 0, 0], atol=1e-15)
    again = combine(
        [shape_mass_properties(halves[:1], 100.0), shape_mass_properties(halves[1:], 300.0)]
    )
    np.testing.assert_allclose(again.inertia, uneven.inertia, atol=1e-15)


def test_flat_objects_still_get_an_inertia_that_mujoco_accepts():
    sheet = trimesh.Trimesh(
        [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]], [[0, 1, 2], [0, 2, 3]]
    )
    inertia = shell_mass_properties(sheet, 0.01).inertia
    values = np.linalg.eigvalsh(inertia)
    assert values[0] > 0 and values[0] + values[1] >= values[2] * (1 - 1e-12)
    assert np.linalg.eigvalsh(second_moments(inertia)).min() > 0


def test_open_mesh_is_taken_as_its_hull(caplog):
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    box.update_faces(np.arange(len(box.faces)) > 1)
    with caplog.at_level(logging.WARNING):
        found = solid_mass_properties(box, 1.0)
    assert "open" in caplog.text
    np.testing.assert_allclose(found.inertia, 1 / 6 * 0.01 * np.eye(3), atol=1e-12)


def test_bad_input():
    box = trimesh.creation.box((1, 1, 1))
    for mass in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="mass is"):
            solid_mass_properties(box, mass)
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(InputError, match="hull|volume"):
        solid_mass_properties(flat, 1.0)
    with pytest.raises(InputError, match="no parts"):
        combine([])
