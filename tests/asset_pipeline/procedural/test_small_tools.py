"""Cutlery, writing things, brushes, razors and turners of the procedural catalogue."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import tests.asset_pipeline.procedural.specimen_checks as checks
from tests.asset_pipeline.procedural.specimen_checks import MM, made

pytestmark = pytest.mark.sample(6)

# Of each category: masses [kg], and the axis, with its sign, along which it reaches farthest; None
# where the shape is symmetric about the grip axis.
TOOLS = {
    "razor": ((0.008, 0.13), "-y"),
    "toothbrush": ((0.008, 0.025), "+z"),
    "spoon": ((0.008, 0.13), "-y"),
    "fork": ((0.004, 0.09), "-y"),
    "spatula": ((0.035, 0.17), "-y"),
    "brush": ((0.010, 0.15), None),
    "marker": ((0.007, 0.04), None),
    "pen": ((0.007, 0.03), "+z"),
    "pencil": ((0.002, 0.012), None),
}
SOME = [(category, index) for category in TOOLS for index in (0, 3, 14)]
each = pytest.mark.parametrize(("category", "index"), SOME)


@pytest.mark.sample(8)
@each
def test_label_size_and_parts(category, index):
    specimen = made(category, index)
    checks.check_label_box(specimen)
    checks.check_size(category, specimen, TOOLS[category][0])
    checks.check_parts(specimen)


@pytest.mark.sample(8)
@each
def test_collision_agrees_with_what_is_seen(category, index):
    checks.check_agreement(made(category, index), 2.0 * MM)


@pytest.mark.sample(2)
@pytest.mark.parametrize(("category", "index"), [(c, i) for c, i in SOME if i < 14])
def test_symmetry_is_that_of_the_shape(category, index):
    checks.check_symmetry(made(category, index))


@pytest.mark.parametrize("category", TOOLS)
def test_instances_differ_and_repeat(category):
    checks.check_repeatable(category, 3, 14)
    designs = [checks.module_of(category).design(index) for index in range(52)]
    assert len(set(designs)) == 52


@each
def test_y_is_the_thin_side_and_points_where_the_rule_says(category, index):
    mesh, side = checks.seen(made(category, index)), TOOLS[category][1]
    low, high = mesh.bounds
    thin, wide = (high - low)[1:]
    if made(category, index).label.symmetry.axial:
        assert abs(wide - thin) < 0.8 * MM
    else:
        assert wide > thin + max(3 * MM, 0.12 * thin)
    for axis, name in ((1, "y"), (2, "z")):
        reach = {"+": high[axis], "-": -low[axis]}
        if side is not None and name == side[1]:
            far, near = (reach[s] for s in (side[0], "-" if side[0] == "+" else "+"))
            assert far > near + 3 * MM and far > 1.12 * near
        else:
            assert abs(reach["+"] - reach["-"]) < 0.3 * MM


@each
def test_grip_is_straight_and_ends_at_the_joint(category, index):
    """Cross-sections of the grip are centred on X; past the origin they soon differ from its last."""
    specimen = made(category, index)
    mesh = checks.seen(specimen)
    grip, functional = specimen.areas
    assert (grip.use, functional.use) == ("grip", "functional")
    assert abs(grip.center[0] + grip.extents[0] / 2) < 1e-9
    assert functional.center[0] - functional.extents[0] / 2 > -1e-9
    end = functional.center[0] + functional.extents[0] / 2
    assert end == pytest.approx(mesh.bounds[1, 0], abs=1e-6)
    for share in (0.05, 0.35, 0.65, 0.95):
        low, high = checks.cross_section(mesh, -share * grip.extents[0])
        if category == "pen" and share > 0.5:
            low, high = low[:1], high[:1]  # the clip is on one side
        assert np.abs(low + high).max() < 0.2 * MM
    before, after = (np.ptp(checks.cross_section(mesh, x), axis=0) for x in (-4 * MM, 10 * MM))
    assert np.abs(after - before).max() > 2 * MM


@each
def test_grip_fits_the_hand(category, index):
    grip = made(category, index).areas[0]
    assert 0.055 < grip.extents[0] < 0.24
    assert 2.2 * MM <= grip.extents[1:].min() < 30 * MM


@pytest.mark.parametrize("index", [0, 1, 2, 3])
def test_spoons_hold_something(index):
    """The bowl's middle lies deeper than its rim all around it."""
    specimen = made("spoon", index)
    mesh, area = checks.seen(specimen), specimen.areas[1]
    middle = area.center[0]
    line = np.linspace(-0.49, 0.49, 9) * area.extents[2]
    start = np.column_stack([np.full(9, middle), np.full(9, 0.05), 0.85 * line])
    hits, rays, _ = mesh.ray.intersects_location(start, np.tile([0.0, -1.0, 0.0], (9, 1)))
    top = np.array([hits[rays == k, 1].max() for k in range(9)])
    assert top.argmin() == 4
    assert min(top[0], top[8]) > top[4] + 2.5 * MM


@pytest.mark.parametrize("index", [0, 2, 4])
def test_pencils_differ_from_round_by_less_than_half_a_millimetre(index):
    mesh = checks.seen(made("pencil", index))
    points = trimesh.intersections.mesh_plane(mesh, [1.0, 0.0, 0.0], [-0.05, 0.0, 0.0])
    radii = np.linalg.norm(np.asarray(points)[..., 1:], axis=-1)
    assert np.ptp(radii) < 0.5 * MM
