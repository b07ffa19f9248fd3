"""The generators' geometry: exact labels, convex parts that agree with what is seen, hollow vessels."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from asset_pipeline.build.emit import model_element
from asset_pipeline.procedural.revolution import MAX_PART_VERTICES
from asset_pipeline.procedural.specimen import Specimen
from manipose_mj.assets import catalogue
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.geometry import Body
from manipose_mj.poses import invert, transform

MM = 1e-3
CATEGORIES = ("chips_can", "mug", "box", "bowl", "cabinet")
SPECIMENS = [(name, index) for name in CATEGORIES for index in (0, 3)]
RIGID = [entry for entry in SPECIMENS if entry[0] != "cabinet"]
each = pytest.mark.parametrize(("category", "index"), SPECIMENS)


@cache
def made(category: str, index: int) -> Specimen:
    return catalogue.generate(category, index)


def whole_surface(specimen: Specimen) -> trimesh.Trimesh:
    return trimesh.util.concatenate([body.surface() for body in specimen.bodies])


def write_model(specimen: Specimen, folder: Path, extra: str = "") -> mujoco.MjModel:
    """The specimen alone, or with more bodies in the world."""
    root = model_element("specimen", specimen.bodies, folder)
    for element in ElementTree.fromstring(f"<extra>{extra}</extra>"):
        root.find("worldbody").append(element)
    ElementTree.ElementTree(root).write(folder / "model.xml")
    return mujoco.MjModel.from_xml_path(str(folder / "model.xml"))


@each
def test_loads_alone_with_the_mass_it_states(category, index, tmp_path):
    specimen = made(category, index)
    model = write_model(specimen, tmp_path)
    for body in specimen.bodies:
        loaded = model.body(body.name)
        assert loaded.mass == pytest.approx(body.mass_properties.mass, rel=1e-6)
        assert loaded.ipos == pytest.approx(body.mass_properties.center_of_mass, abs=1e-6)
    assert model.nu == 0 and model.neq == 0


@each
def test_label_box_is_the_visual_bounding_box(category, index):
    specimen = made(category, index)
    points = transform(invert(specimen.label.pose), np.asarray(whole_surface(specimen).vertices))
    half = specimen.label.extents / 2
    assert np.abs(points.max(axis=0) - half).max() < 0.5 * MM
    assert np.abs(points.min(axis=0) + half).max() < 0.5 * MM
    assert specimen.label.rotation[:, 0] == pytest.approx([0, 0, 1])
    assert np.linalg.det(specimen.label.rotation) == pytest.approx(1)


@each
def test_collision_parts_are_convex_and_small(category, index):
    parts = [shape for body in made(category, index).bodies for shape in body.collision]
    assert len(parts) <= 70
    for shape in parts:
        if shape.mesh is None:
            assert min(shape.size) > 0
            continue
        vertices, mesh = np.asarray(shape.mesh.vertices), shape.mesh
        assert len(vertices) <= MAX_PART_VERTICES
        assert mesh.is_watertight and mesh.volume > 0
        above = np.einsum("fk,vfk->vf", mesh.face_normals, vertices[:, None] - mesh.triangles[:, 0])
        assert above.max() < 1e-7


def collision_skin(body: Body) -> np.ndarray:
    """Points of the collision parts' surface that something outside could touch."""
    parts = [shape.surface(96) for shape in body.collision]
    skin = trimesh.util.concatenate(parts)
    corners = 0.98 * skin.triangles + 0.02 * skin.triangles.mean(axis=1, keepdims=True)
    spread, faces = trimesh.sample.sample_surface(skin, 500, seed=1)
    points = np.concatenate([corners.reshape(-1, 3)[::5], spread])
    normals = np.concatenate(
        [np.repeat(skin.face_normals, 3, axis=0)[::5], skin.face_normals[faces]]
    )
    # Gaps between neighbouring parts narrower than this are inside for all purposes.
    probes = points + 0.7 * MM * normals
    covered = np.zeros(len(points), bool)
    for part in parts:
        offsets = np.einsum("fk,fk->f", part.face_normals, part.triangles[:, 0])
        covered |= (probes @ part.face_normals.T - offsets).max(axis=1) < 1e-6
    return points[~covered]


@each
def test_collision_parts_agree_with_what_is_seen(category, index):
    for body in made(category, index).bodies:
        seen = body.surface()
        touched = trimesh.util.concatenate([shape.surface(96) for shape in body.collision])
        points = np.concatenate([seen.sample(400, seed=1), seen.vertices[::17]])
        assert trimesh.proximity.closest_point(touched, points)[1].max() < 1.5 * MM
        assert trimesh.proximity.closest_point(seen, collision_skin(body))[1].max() < 1.5 * MM


def mirrors(specimen: Specimen) -> list[np.ndarray]:
    """The maps that leave the shape as it is, in the label frame."""
    reflect_z, reflect_y = np.diag([1.0, 1.0, -1.0]), np.diag([1.0, -1.0, 1.0])
    turns = list(specimen.label.symmetry.rotations)
    if specimen.label.symmetry.axial:
        return [*turns, reflect_z, reflect_y]
    return [*turns, reflect_z] + ([reflect_y] if len(turns) > 1 else [])


@pytest.mark.parametrize(("category", "index"), RIGID)
def test_collision_shape_has_the_symmetry_of_its_label(category, index):
    specimen = made(category, index)
    surface = trimesh.util.concatenate([s.surface(96) for s in specimen.bodies[0].collision])
    points = transform(invert(specimen.label.pose), np.asarray(surface.vertices))
    tree = cKDTree(points)
    for mirror in mirrors(specimen):
        assert tree.query(points @ mirror.T)[0].max() < 0.1 * MM


@pytest.mark.parametrize("index", [0, 3])
def test_bowl_wedges_turn_into_one_another(index):
    specimen = made("bowl", index)
    angle = 2 * np.pi / 16
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    points = np.concatenate([s.mesh.vertices for s in specimen.bodies[0].collision if s.mesh])
    turned = np.column_stack([points[:, :2] @ turn.T, points[:, 2]])
    assert cKDTree(points).query(turned)[0].max() < 0.1 * MM


@pytest.mark.parametrize("index", [0, 4])
def test_square_carton_has_quarter_turns_and_no_other_has(index):
    label = made("box", index).label
    square = abs(label.extents[1] - label.extents[2]) < 1e-9
    assert square == (index == 4)
    assert len(label.symmetry.rotations) == (8 if square else 4)


@pytest.mark.parametrize("category", ["mug", "bowl"])
@pytest.mark.parametrize("index", [0, 3])
def test_vessels_hold_a_ball(category, index, tmp_path):
    specimen = made(category, index)
    height = specimen.label.extents[0]
    centre = specimen.bodies[0].mass_properties.center_of_mass
    model = write_model(
        specimen,
        tmp_path,
        f"""<geom type="plane" size="1 1 1" pos="0 0 {-height / 2 - 1e-4}"/>
        <body name="ball" pos="{centre[0] - 0.004} {centre[1] + 0.003} {height / 2 + 0.03}">
          <freejoint/><geom size=".015" mass=".03"/></body>""",
    )
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 750)
    ball = invert(pose_of(data, category)) @ [*data.body("ball").xpos, 1.0]
    assert -height / 2 + 0.015 < ball[2] < 0.1 * height
    assert np.hypot(*(ball[:2] - centre[:2])) < specimen.label.extents[2] / 2 - 0.01


def pose_of(data: mujoco.MjData, body: str) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = data.body(body).xmat.reshape(3, 3), data.body(body).xpos
    return pose


def test_chips_can_is_the_ycb_one():
    specimen = made("chips_can", 0)
    assert specimen.label.extents == pytest.approx([0.250, 0.075, 0.075])
    assert specimen.bodies[0].mass_properties.mass == pytest.approx(0.205)
    assert [shape.kind for shape in specimen.bodies[0].collision] == ["cylinder"]


RANGES = {  # extents along the label's X, Y, Z [mm], with the handle and lips
    "chips_can": ((150, 255), (66, 76), (66, 76)),
    "mug": ((80, 110), (102, 135), (72, 95)),
    "box": ((90, 210), (55, 140), (30, 70)),
    "bowl": ((45, 75), (118, 170), (118, 170)),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize("category", CATEGORIES[:4])
def test_sizes_stay_in_their_ranges_and_differ(category):
    count = CATALOGUE[category].instances
    extents = np.array([made(category, index).label.extents for index in range(count)]) / MM
    low, high = np.array(RANGES[category]).T
    assert (extents >= low - 0.7).all() and (extents <= high + 0.7).all()
    assert len(np.unique(extents.round(3), axis=0)) == count
    masses = [made(category, i).bodies[0].mass_properties.mass for i in range(count)]
    assert min(masses) > 0.05 and max(masses) < 1.1
