"""Toys, vessels with handles, headgear, handbags and cameras of the procedural catalogue."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

import tests.asset_pipeline.procedural.specimen_checks as checks
from asset_pipeline.build.emit import model_element
from asset_pipeline.procedural.shell import revolved_loops, wall_parts
from manipose_mj.assets.categories import CATALOGUE
from tests.asset_pipeline.procedural.specimen_checks import MM, made

pytestmark = pytest.mark.sample(6)

# Of each category: masses [kg]; how far looks and collision parts may be apart [mm]; the greatest
# number of parts.
OBJECTS = {
    "toy_car": ((0.03, 0.35), 2.5, 26),
    "toy_airplane": ((0.02, 0.30), 2.5, 56),
    "teapot": ((0.20, 0.60), 2.5, 28),
    "pitcher": ((0.15, 0.50), 3.6, 46),
    "pot": ((0.25, 0.90), 3.8, 48),
    "hat": ((0.05, 0.18), 4.5, 50),
    "helmet": ((0.15, 0.42), 5.0, 58),
    "handbag": ((0.25, 0.60), 3.5, 30),
    "camera": ((0.15, 0.60), 2.0, 24),
}
TWO_PLANES = ("pot", "handbag")
SOME = [(category, index) for category in OBJECTS for index in (0, 3, 14)]
each = pytest.mark.parametrize(("category", "index"), SOME)


@pytest.mark.sample(8)
@each
def test_label_size_and_parts(category, index):
    specimen = made(category, index)
    masses, _, parts = OBJECTS[category]
    checks.check_label_box(specimen)
    checks.check_size(category, specimen, masses)
    checks.check_parts(specimen, parts)
    assert np.allclose(specimen.label.rotation[:, 0], [0, 0, 1])


@pytest.mark.sample(8)
@each
def test_collision_agrees_with_what_is_seen(category, index):
    # Parts of a helmet's thick foam meet in twisted faces, with gaps that nothing reaches.
    gap = 3 * MM if category == "helmet" else 0.7 * MM
    checks.check_agreement(made(category, index), OBJECTS[category][1] * MM, gap)


@pytest.mark.sample(2)
@pytest.mark.parametrize(("category", "index"), [(c, i) for c, i in SOME if i < 14])
def test_symmetry_is_that_of_the_shape(category, index):
    checks.check_symmetry(made(category, index))


@pytest.mark.parametrize("category", OBJECTS)
def test_instances_differ_and_repeat(category):
    checks.check_repeatable(category, 3, 14)
    designs = [checks.module_of(category).design(index) for index in range(52)]
    assert len(set(designs)) == 52


@each
def test_planes_mirror_the_parts(category, index):
    """Colours and half a millimetre apart, both sides of every plane collide alike."""
    specimen = made(category, index)
    corners = np.concatenate([s.surface().vertices for s in specimen.bodies[0].collision])
    local = (corners - specimen.label.origin) @ specimen.label.rotation
    for axis in (2, 1) if category in TWO_PLANES else (2,):
        flip = np.ones(3)
        flip[axis] = -1
        gap = np.linalg.norm(local[:, None] - (local * flip)[None, ::7], axis=2).min(axis=0)
        assert gap.max() < 0.5 * MM


@pytest.mark.sample(2)
@pytest.mark.parametrize("category", [c for c in OBJECTS if c not in TWO_PLANES])
def test_y_points_to_where_the_box_reaches_farther_from_the_surface(category):
    for index in range(0, 52, 5):
        mesh = checks.seen(made(category, index))
        low, high = mesh.bounds[:, 1]
        assert (high - mesh.centroid[1]) - (mesh.centroid[1] - low) > 0.04 * (high - low)


@pytest.mark.parametrize("category", TWO_PLANES)
def test_y_is_the_clearly_longer_of_two(category):
    for index in range(0, 52, 5):
        _, y, z = made(category, index).label.extents
        assert y > 1.08 * z


@pytest.mark.parametrize("category", ["pot", "pitcher"])
@pytest.mark.parametrize("index", [0, 3])
def test_vessels_hold_a_ball(category, index, tmp_path):
    resting = dropped_ball(category, index, tmp_path)
    assert -0.5 < resting[0] < -0.2
    assert np.abs(resting[1:]).max() < 0.35


@pytest.mark.parametrize("category", ["hat", "helmet"])
def test_headgear_is_hollow(category, tmp_path):
    """Upside down, a ball falls down to the crown."""
    assert 0.15 < dropped_ball(category, 3, tmp_path, upside_down=True)[0] < 0.5


def dropped_ball(category: str, index: int, folder: Path, upside_down: bool = False) -> np.ndarray:
    """Where a ball of 30 mm comes to rest in the fixed object, in its box's lengths from the middle."""
    specimen = made(category, index)
    label = specimen.label
    sign = -1 if upside_down else 1
    root = model_element("specimen", specimen.bodies, folder)
    world = root.find("worldbody")
    assert world is not None
    obj = world.find("body")
    assert obj is not None
    joint = obj.find("freejoint")
    assert joint is not None
    obj.remove(joint)
    option = ElementTree.SubElement(root, "option")
    option.set("gravity", f"0 0 {-9.81 * sign}")
    start = sign * (label.extents[0] / 2 + 0.03)
    ball = ElementTree.SubElement(world, "body", name="ball", pos=f"-0.004 0.003 {start}")
    ElementTree.SubElement(ball, "freejoint")
    ElementTree.SubElement(ball, "geom", size=".015", mass=".03", condim="6", friction="1 .01 .001")
    ElementTree.ElementTree(root).write(folder / "model.xml")
    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 700)
    return (data.body("ball").xpos - label.origin) @ label.rotation / label.extents


@each
def test_grip_areas_lie_in_the_box(category, index):
    specimen = made(category, index)
    grips = [area for area in specimen.areas if area.use == "grip"]
    assert grips
    for area in grips:
        reach = np.abs(area.center) + area.extents / 2
        assert (reach <= specimen.label.extents / 2 + 1 * MM).all()


def test_walls_of_a_shell_leave_no_gaps_and_keep_its_hollow():
    """A cylindrical wall of 3 mm: its middle is covered, its hollow is intruded on by half a sagitta."""
    radius, wedges = 0.06, 12
    outer = revolved_loops(np.array([[radius, 0.0], [radius, 0.05], [radius, 0.1]]), 48)
    inner = revolved_loops(np.array([[0.057, 0.0], [0.057, 0.05], [0.057, 0.1]]), 48)
    parts = wall_parts(outer, inner, (0, 2), (wedges,))
    assert len(parts) == wedges
    angles = np.linspace(0, 2 * np.pi, 500)
    sagitta = 0.057 * (1 - np.cos(np.pi / wedges))

    def covered(r: float) -> float:
        points = np.stack([r * np.cos(angles), r * np.sin(angles), np.full(500, 0.05)], axis=1)
        inside = np.zeros(500, bool)
        for shape in parts:
            mesh = shape.surface()
            levels = np.einsum("fk,fk->f", mesh.face_normals, mesh.triangles[:, 0])
            inside |= (points @ mesh.face_normals.T - levels).max(axis=1) < 1e-5
        return float(inside.mean())

    assert covered(0.0585) > 0.99
    assert covered(0.057 - 0.6 * sagitta) == 0.0


def test_hats_take_turns_and_caps_are_among_them():
    styles = [checks.module_of("hat").design(index).style for index in range(11)]
    assert set(styles) == {"cap", "fedora", "bucket", "sun"}
    assert styles[0] == "cap" and CATALOGUE["hat"].instances == 52
