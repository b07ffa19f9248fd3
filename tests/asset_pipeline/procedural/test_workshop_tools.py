"""Workshop, kitchen and cleaning tools of the procedural catalogue."""

from __future__ import annotations

from typing import cast

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

import tests.asset_pipeline.procedural.specimen_checks as checks
from manipose_mj.poses import SymmetryGroup, invert
from tests.asset_pipeline.procedural.specimen_checks import MM, made
from tests.asset_pipeline.procedural.test_generators import pose_of, write_model

pytestmark = pytest.mark.sample(6)

# Of each category: masses [kg], the label's axis across the tool's mirror plane, and towards which
# side of the other one it reaches farther where it does.
TOOLS = {
    "hammer": ((0.25, 0.66), "y", "+z"),
    "screwdriver": ((0.04, 0.17), "y", "+z"),
    "spanner": ((0.08, 0.48), "y", "+z"),
    "scissor": ((0.04, 0.24), "y", "+z"),
    "cutter": ((0.045, 0.11), "y", "+z"),
    "knife": ((0.03, 0.17), "y", "+z"),
    "pan": ((0.23, 0.55), "z", "-y"),
    "dustpan": ((0.10, 0.19), "z", "-y"),
    "squeegee": ((0.10, 0.21), "y", "+z"),
}
HALF_TURN = np.diag([1.0, -1.0, -1.0])
SOME = [(category, index) for category in TOOLS for index in (0, 3, 14)]
each = pytest.mark.parametrize(("category", "index"), SOME)
category_wise = pytest.mark.parametrize("category", TOOLS)


@pytest.mark.sample(8)
@each
def test_label_size_and_parts(category, index):
    specimen = made(category, index)
    checks.check_label_box(specimen)
    checks.check_size(category, specimen, TOOLS[category][0])
    checks.check_parts(specimen, most=44)


@pytest.mark.sample(8)
@each
def test_collision_agrees_with_what_is_seen(category, index):
    checks.check_agreement(made(category, index), 1.8 * MM)


@each
def test_group_is_that_of_the_shape(category, index):
    """What is in the group leaves nearly all of the surface in place; half a turn elsewhere does not."""
    specimen = made(category, index)
    mesh, group = checks.seen(specimen), specimen.label.symmetry
    dense, faces = trimesh.sample.sample_surface(mesh, 20_000, seed=0)[:2]
    tree, probes = cKDTree(dense), dense[::20]

    def moved_by(turn: np.ndarray) -> np.ndarray:
        """Distances [m] to the planes of the nearest samples, or to these where they are far."""
        moved = probes @ turn.T
        distance, nearest = tree.query(moved)
        normals = mesh.face_normals[faces[nearest]]
        plane = np.abs(np.einsum("ij,ij->i", moved - dense[nearest], normals))
        return np.where(distance > 4 * MM, distance, plane)

    for turn in group.sampled(7):
        assert np.percentile(moved_by(turn), 95) < 1.0 * MM
    if len(group.rotations) == 1 and not group.axial:
        assert moved_by(HALF_TURN).max() > 4 * MM


@pytest.mark.sample(3)
@category_wise
def test_every_instance_reaches_farther_to_the_side_of_the_rule_or_is_symmetric(category):
    """Over all instances: what breaks the symmetry is clear, and the row of the catalogue is right."""
    normal, far = TOOLS[category][1:]
    groups = set()
    for index in range(0, 52, 7):
        specimen = made(category, index)
        group = specimen.label.symmetry
        groups.add("axis" if group.axial else ("none", "half turn")[len(group.rotations) - 1])
        low, high = checks.seen(specimen).bounds
        if group.axial:
            assert abs(np.ptp(specimen.label.extents[1:])) < 2.5 * MM
            continue
        y, z = specimen.label.extents[1:]
        assert z > y + 3 * MM and z > 1.12 * y
        other = {"x": 0, "y": 1, "z": 2}[normal]
        assert abs(high[other] + low[other]) < 0.3 * MM
        axis = 3 - other
        reach = (high[axis], -low[axis]) if far[0] == "+" else (-low[axis], high[axis])
        if len(group.rotations) > 1:
            assert abs(reach[0] - reach[1]) < 0.1 * MM
        else:
            assert reach[0] > reach[1] + 3 * MM and reach[0] > 1.12 * reach[1]
    row = checks.CATALOGUE[category].symmetry
    assert groups == ({"none", "half turn"} if row == "varies" else {row})


@category_wise
def test_instances_differ_and_repeat(category):
    checks.check_repeatable(category, 3, 14)
    design = checks.module_of(category).design
    assert len({design(index) for index in range(52)}) == 52


@each
def test_grip_is_straight_and_ends_at_the_joint(category, index):
    """The grip's sections are centred on X; behind the origin the section is another."""
    specimen = made(category, index)
    mesh = checks.seen(specimen)
    grip, functional = specimen.areas
    assert (grip.use, functional.use) == ("grip", "functional")
    assert abs(grip.center[0] + grip.extents[0] / 2) < 1e-9
    assert abs(functional.center[0] - functional.extents[0] / 2) < 1e-9
    slack = 2.5 * MM if category == "cutter" else 0.3 * MM  # its slider is on one side
    two_loops = category == "scissor" and len(specimen.label.symmetry.rotations) == 1
    for share in (0.02,) if two_loops else (0.05, 0.35, 0.65, 0.95):
        low, high = checks.cross_section(mesh, -share * grip.extents[0])
        assert np.abs(low + high).max() < slack
    before, after = (np.ptp(checks.cross_section(mesh, x), axis=0) for x in (-3 * MM, 5 * MM))
    assert np.abs(after - before).max() > 3 * MM


@pytest.mark.parametrize("index", [0, 3])
def test_pans_hold_a_ball(index, tmp_path):
    specimen = made("pan", index)
    centre = specimen.label.origin + [specimen.label.extents[2] / 2, 0.0, 0.0]
    bottom = float(specimen.bodies[0].surface().vertices[:, 2].min())
    model = write_model(
        specimen,
        tmp_path,
        f"""<geom type="plane" size="1 1 1" pos="0 0 {bottom - 1e-4}"/>
        <body name="ball" pos="{centre[0] - 0.02} {centre[1] + 0.01} {bottom + 0.06}">
          <freejoint/><geom size=".012" mass=".02"/></body>""",
    )
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    ball = invert(pose_of(data, "pan")) @ [*data.body("ball").xpos, 1.0]
    assert bottom + 0.012 < ball[2] < bottom + 0.019
    assert np.hypot(*(ball[:2] - centre[:2])) < specimen.label.extents[2] / 2 - 0.01


@pytest.mark.parametrize(("category", "index"), [("scissor", 0), ("scissor", 9), ("spanner", 3)])
def test_loops_and_rings_are_open(category, index):
    """A peg passes through: a line along Y meets no collision part, but has some on all four sides."""
    specimen = made(category, index)
    solid = cast(
        trimesh.Trimesh,
        trimesh.util.concatenate([s.surface() for s in specimen.bodies[0].collision]),
    )
    solid.vertices = (np.asarray(solid.vertices) - specimen.label.origin) @ specimen.label.rotation
    design = checks.module_of(category).design(index)
    if category == "scissor":
        loop, bar = design.fingers, design.bar
        centre = np.array([-design.shank - loop.long, 0.0, loop.wide + bar])
        free, around = 0.6 * loop.wide, loop.long + bar / 2
    else:
        centre = np.array([0.72 * design.jaw, 0.0, 0.0])
        free, around = 0.4 * design.jaw, 0.66 * design.jaw
    sides = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]])
    starts = centre + np.concatenate([free * sides, around * sides[:2]]) + [0, 0.05, 0]
    met = solid.ray.intersects_any(starts, np.tile([0.0, -1.0, 0.0], (6, 1)))
    assert met.tolist() == [False] * 4 + [True] * 2


def test_mallets_and_rings_turn_and_others_do_not():
    two_planes, identity = (
        len(g.rotations) for g in (SymmetryGroup.two_planes(), SymmetryGroup.identity())
    )
    for category, symmetric in (("hammer", {"rubber", "beech"}), ("spanner", {"ring"})):
        design = checks.module_of(category).design
        for index in range(10):
            members = len(made(category, index).label.symmetry.rotations)
            assert members == (two_planes if design(index).style in symmetric else identity)
