"""Clocks, mice, containers, cartons, notebooks, remotes, tape measures, tissues and wallets."""

from __future__ import annotations

import numpy as np
import pytest

import tests.asset_pipeline.procedural.specimen_checks as checks
from asset_pipeline.labelling.surface_cloud import SurfaceCloud
from asset_pipeline.labelling.surface_symmetry import residual
from asset_pipeline.procedural.mirror import computer_mouse, notebook, tissue, wallet
from tests.asset_pipeline.procedural.specimen_checks import MM, made

pytestmark = pytest.mark.sample(6)

# Of each category: masses [kg].
MASSES = {
    "clock": (0.06, 0.45),
    "computer_mouse": (0.05, 0.16),
    "container": (0.06, 0.60),
    "drinkbox": (0.10, 0.60),
    "notebook": (0.05, 0.40),
    "remote": (0.04, 0.20),
    "steel_tape": (0.08, 0.50),
    "tissue": (0.05, 0.35),
    "wallet": (0.05, 0.35),
}
CLEAR = 0.04  # by which share of its length a thing reaches farther on Y's side
SOME = [(category, index) for category in MASSES for index in (0, 2, 16)]
each = pytest.mark.parametrize(("category", "index"), SOME)
few = pytest.mark.parametrize(("category", "index"), [pair for pair in SOME if pair[1] != 16])


@pytest.mark.sample(8)
@each
def test_label_size_and_parts(category, index):
    specimen = made(category, index)
    checks.check_label_box(specimen)
    checks.check_size(category, specimen, MASSES[category])
    checks.check_parts(specimen)
    assert specimen.areas and all(area.use == "grip" for area in specimen.areas)


@pytest.mark.sample(8)
@each
def test_collision_agrees_with_what_is_seen(category, index):
    checks.check_agreement(made(category, index), 2.0 * MM)


@pytest.mark.sample(2)
@few
def test_symmetry_is_that_of_the_shape(category, index):
    checks.check_symmetry(made(category, index))


@pytest.mark.sample(2)
@few
def test_xy_is_a_mirror_plane(category, index):
    """All but a belt clip, which is less than a millimetre thick, has its counterpart across it."""
    mesh = checks.seen(made(category, index))
    low, high = mesh.bounds
    assert abs(low[2] + high[2]) < 0.2 * MM
    cloud = SurfaceCloud.of(mesh)
    assert residual(cloud, np.diag([1.0, 1.0, -1.0]), np.zeros(3), 98.0) < 1.2 * MM


@pytest.mark.parametrize("category", MASSES)
def test_y_points_where_the_rule_says(category):
    """Along the longer side where half a turn about X is in the group, else to the side that reaches out."""
    for index in range(5):
        specimen = made(category, index)
        mesh, group = checks.seen(specimen), specimen.label.symmetry
        low, high = mesh.bounds
        _, y, z = specimen.label.extents
        about_x = any(np.allclose(turn, np.diag([1.0, -1.0, -1.0])) for turn in group.rotations)
        centre = mesh.area_faces @ mesh.triangles_center / mesh.area
        reach = ((low + high) / 2 - centre)[1]
        if about_x:
            assert abs(reach) < 0.01 * y
            assert y > 1.08 * z or abs(y - z) < 0.1 * MM
        else:
            assert reach > CLEAR * y, (index, reach / y)


@pytest.mark.parametrize("category", MASSES)
def test_instances_differ_and_repeat(category):
    checks.check_repeatable(category, 2, 16)
    designs = [checks.module_of(category).design(index) for index in range(52)]
    assert len(set(designs)) == 52


@each
def test_one_width_fits_the_hand(category, index):
    """Some pair of opposite faces of the case itself is less than 74 mm apart."""
    area = made(category, index).areas[0]
    assert 4 * MM <= area.extents.min() < 74 * MM


def test_groups_vary_as_the_styles_do():
    groups = {"notebook": set(), "wallet": set(), "tissue": set(), "drinkbox": set()}
    for category, found in groups.items():
        found.update(len(made(category, index).label.symmetry.rotations) for index in range(6))
    assert groups == {
        "notebook": {1, 2, 4},
        "wallet": {1, 2, 4},
        "tissue": {2, 4},
        "drinkbox": {1, 2},
    }


def test_a_mouse_is_high_at_its_palm_and_its_cord_is_in_front():
    item = computer_mouse.design(0)
    mesh = checks.seen(made("computer_mouse", 0))
    points = mesh.vertices
    palm = points[points[:, 0].argmax(), 1]
    front = points[points[:, 1].argmax()]
    assert palm < 0 < front[1]
    assert front[0] < 0 and item.cord > 0.01


def test_flat_objects_have_thickness():
    for index in range(8):
        for module in (notebook, wallet):
            assert module.design(index).thickness >= 8 * MM
        assert tissue.design(index).out > 0.03
