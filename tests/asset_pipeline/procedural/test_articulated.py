"""Cabinets, microwave ovens and ovens: do they open, stay, hold a ball, and can a hand take them?"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
import trimesh

from asset_pipeline.catalogue import instance
from asset_pipeline.checks.asset_check import check_asset
from asset_pipeline.checks.cavity_check import takes_ball
from asset_pipeline.labelling.handle_label import handle_label
from asset_pipeline.procedural.articulated import cabinet, microwave, oven
from asset_pipeline.procedural.articulated.cabinets.layout import (
    Cell,
    Layout,
    Lines,
    levels,
    uprights,
)
from asset_pipeline.procedural.articulated.handles.bar_handle import BarHandle
from asset_pipeline.procedural.articulated.handles.bow_handle import BowHandle
from asset_pipeline.procedural.articulated.handles.edge_pull import EdgePull
from asset_pipeline.procedural.articulated.handles.knob import Knob
from asset_pipeline.procedural.articulated.handles.mounted import OUT, Mounted
from asset_pipeline.procedural.specimen import Specimen
from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.poses import invert, pose_error, rotation_about, rotation_to_quaternion, transform
from tests.asset_pipeline.procedural.articulated_scene import all_ways, on_table, pull, touching
from tests.asset_pipeline.procedural.specimen_checks import check_agreement

pytestmark = pytest.mark.sample(6)

# Cabinets: chest of two; double doors with a shelf; drawer and door; wide drawer over double doors.
SPECIMENS = [("cabinet", k) for k in (0, 1, 2, 6, 12)]
SPECIMENS += [("microwave", k) for k in (0, 1, 2, 3)] + [("oven", k) for k in (0, 1, 3, 7)]
MODULES = {"cabinet": cabinet, "microwave": microwave, "oven": oven}
BASE_MASS = {"cabinet": (6.0, 32.0), "microwave": (9.0, 16.0), "oven": (6.0, 32.0)}  # [kg]
HANDLES = (BarHandle(), BowHandle(), Knob(), EdgePull())
OPENING_FORCE = 15.0  # [N], what a Panda pulls with ease
each = pytest.mark.parametrize(("category", "index"), SPECIMENS)


@cache
def made(category: str, index: int) -> Specimen:
    return MODULES[category].generate(index)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Asset folders, built once."""
    root = tmp_path_factory.mktemp("built")

    @cache
    def build(category: str, index: int) -> Asset:
        return instance.build(category, index, root / f"{category}_{index:03d}")

    return build


@pytest.mark.sample(4)
@each
def test_shut_parts_stay_shut_and_open_under_a_modest_force(category, index, built):
    assert check_asset(built(category, index).folder).failures == ()


@each
def test_every_cavity_takes_a_ball_and_keeps_it(category, index, built):
    asset = built(category, index)
    for part in asset.parts:
        assert part.cavity is not None and takes_ball(asset, part) == ""


@each
def test_nothing_touches_anywhere_in_the_ranges(category, index, tmp_path):
    model = on_table(made(category, index), tmp_path)
    assert touching(model, all_ways(model.njnt)) == []
    # A part pushed 2 cm into the object does touch it.
    for joint in range(model.njnt):
        reach = 0.02 if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE else 0.2
        beyond = -reach / (model.jnt_range[joint, 1] - model.jnt_range[joint, 0])
        assert touching(model, beyond * np.eye(model.njnt)[[joint]])


@each
def test_parts_open_by_their_handles_and_shut_again(category, index, tmp_path):
    specimen = made(category, index)
    model = on_table(specimen, tmp_path)
    for part in specimen.parts[:3]:
        data = mujoco.MjData(model)
        while data.time < 2.0:
            pull(model, data, part, OPENING_FORCE)
        assert data.joint(part.name).qpos[0] > 0.95 * part.joint.range[1], part.name
        while data.time < 4.0:
            pull(model, data, part, -OPENING_FORCE)
        assert abs(data.joint(part.name).qpos[0]) < 3e-3, part.name


@each
@pytest.mark.parametrize("share", [0.15, 0.5, 0.85, 1.0])
def test_parts_stay_where_they_are_left(category, index, share, tmp_path):
    model = on_table(made(category, index), tmp_path)
    data = mujoco.MjData(model)
    left = share * model.jnt_range[:, 1]
    data.qpos[:] = left
    mujoco.mj_step(model, data, 500)
    assert data.qpos == pytest.approx(left, abs=2e-3)


@pytest.mark.parametrize("index", [0, 1, 3])
def test_an_open_oven_door_bears_a_kilogram(index, tmp_path):
    specimen = made("oven", index)
    joint = specimen.parts[0].joint
    low, high = _bounds(specimen, "door")
    place = f"{joint.origin[0] - 0.6 * (high[2] - low[2])} 0 {joint.origin[2] + 0.028}"
    load = f'<body pos="{place}"><freejoint/><geom type="box" size=".05 .05 .025" mass="1"/></body>'
    model = on_table(specimen, tmp_path, load)
    data = mujoco.MjData(model)
    data.joint("door").qpos = joint.range[1]
    mujoco.mj_step(model, data, 1000)
    assert data.joint("door").qpos[0] < joint.range[1] + 0.02
    assert data.body(model.nbody - 1).xpos[2] > joint.origin[2]


@each
def test_cavities_are_free_and_bounded(category, index, tmp_path):
    """A box 1 mm smaller than a cavity touches nothing, one 24 mm larger does."""
    specimen = made(category, index)
    for part in specimen.parts:
        for grown, free in ((-0.001, True), (0.024, False)):
            folder = tmp_path / f"{part.name}{grown}"
            folder.mkdir()
            probe = _box(part.cavity.center, np.eye(3), (part.cavity.extents + grown) / 2)
            data = _forward(on_table(specimen, folder, probe))
            assert (data.ncon == 0) == free, part.name


@each
def test_the_gripper_fits_around_every_handle(category, index, tmp_path):
    """The Franka hand comes straight in with 6 mm to spare on both sides; shut, it meets the handle."""
    specimen, jaw = made(category, index), ParallelJaw()
    for part in specimen.parts:
        width = float(part.handle.extents[2])
        # Of the hand's own boxes the wrist's stay out of reach of the front in any case.
        for opening, fits in ((width + 2 * jaw.clearance, True), (width - 0.001, False)):
            folder = tmp_path / f"{part.name}{fits}"
            folder.mkdir()
            model = on_table(specimen, folder, _hand(jaw, part, opening))
            # A hand that comes in level may meet the table: it can come in tilted.
            met = {model.geom(g).name for c in _forward(model).contact for g in c.geom}
            assert (met <= {"table", ""}) == fits, (part.name, met)


def _hand(jaw: ParallelJaw, part: MovingPart, opening: float) -> str:
    """The hand's boxes in the pose in which it takes a handle."""
    x, y, z = part.handle.rotation.T
    rotation = np.stack([x, np.cross(-y, x), -y], axis=1)
    boxes = jaw.boxes(np.array([opening]))[0]
    return "".join(
        _box(part.handle.origin + rotation @ ends.mean(axis=0), rotation, np.ptp(ends, axis=0) / 2)
        for ends in boxes
    )


@each
def test_handles_are_labelled_on_every_part(category, index):
    for part in made(category, index).parts:
        label = part.handle
        assert label is not None and label.object_type == "handle"
        assert label.rotation[:, 1] == pytest.approx(OUT)
        assert np.linalg.det(label.rotation) == pytest.approx(1)
        level = part.joint.kind == "slide" or category == "oven"
        assert label.rotation[2, 2 if level else 0] == pytest.approx(1)
        # Positive joint motion takes the handle outwards.
        before = label.origin
        if part.joint.kind == "slide":
            after = before + 0.01 * part.joint.axis
        else:
            turn = rotation_about(part.joint.axis, 0.05)
            after = turn @ (before - part.joint.origin) + part.joint.origin
        assert (after - before)[0] < -0.005


@each
def test_sizes_are_real_and_shapes_few(category, index):
    specimen = made(category, index)
    low, high = catalogue.CATALOGUE[category].size
    assert low <= specimen.label.extents.max() <= high
    bounds = np.array([body.surface().bounds for body in specimen.bodies])
    assert np.ptp([bounds[:, 0].min(0), bounds[:, 1].max(0)], axis=0)[[2, 0, 1]] == pytest.approx(
        specimen.label.extents
    )
    assert bounds[:, 0, 2].min() == pytest.approx(0, abs=0.004)
    least, most = BASE_MASS[category]
    assert least < specimen.bodies[0].mass_properties.mass < most
    for body in specimen.bodies:
        assert len(body.collision) <= 60
        assert len(body.surface().faces) <= 12_000
        for shape in body.collision:
            assert shape.kind == "box" or len(shape.mesh.vertices) <= 32


@pytest.mark.sample(4)
@each
def test_what_is_seen_is_what_is_touched(category, index):
    specimen = made(category, index)
    for body in specimen.bodies:
        check_agreement(replace(specimen, bodies=(body,)), 0.003)


@pytest.mark.parametrize("category", list(MODULES))
def test_an_index_is_always_the_same_and_no_other(category, built, tmp_path):
    first, again = built(category, 1), instance.build(category, 1, tmp_path / f"{category}_001")
    files = {p.relative_to(first.folder): p.read_bytes() for p in _files(first.folder)}
    assert files == {p.relative_to(again.folder): p.read_bytes() for p in _files(again.folder)}
    others = [made(category, k).label.extents for c, k in SPECIMENS if c == category and k != 1]
    assert all(np.abs(extents - first.label.extents).max() > 1e-3 for extents in others)


def test_every_design_of_the_catalogue_is_within_its_bounds():
    kinds = set()
    for index in range(catalogue.CATALOGUE["cabinet"].instances):
        c = cabinet.design(index)
        kinds.add(
            tuple((cell.kind, cell.columns, cell.rows, cell.hinge) for cell in c.layout.cells)
        )
        assert 0.30 <= c.height + c.crown <= 0.90 and c.width <= 0.90
        covered = np.zeros((len(c.layout.columns), len(c.layout.rows)), int)
        for cell in c.layout.cells:
            covered[slice(*cell.columns), slice(*cell.rows)] += 1
        assert (covered == 1).all()
        names = [cell.name for cell in c.layout.cells]
        assert len(set(names)) == len(names)
        if any(cell.kind == "drawer" for cell in c.layout.cells):
            # As far as the depth allows, and 0.30 m where it allows that.
            assert c.travel >= min(0.30, c.depth - 0.09) and c.travel < c.inner_depth
            assert c.wall_height + c.wall + c.gap < min(c.layout.rows)
    assert len(kinds) >= 14
    sides = {microwave.design(k).hinge for k in range(30)}
    assert sides == {"left", "right"}
    assert {bool(oven.design(k).panel) for k in range(30)} == {True, False}


def test_a_board_ends_where_it_meets_another():
    """Two drawers over a wide door, beside a tall door: the short upright stands on the level board."""
    cells = (
        Cell("wide", "door", (0, 2), (0, 1)),
        Cell("a", "drawer", (0, 1), (1, 2)),
        Cell("b", "drawer", (1, 2), (1, 2)),
        Cell("tall", "door", (2, 3), (0, 2)),
    )
    layout = Layout((0.2, 0.2, 0.3), (0.3, 0.1), cells)
    assert uprights(layout) == [(1, (1, 2)), (2, (0, 2))]
    assert levels(layout) == [(1, (0, 2))]
    lines = Lines.between(layout.rows, 0.02, 0.1)
    assert lines.at == pytest.approx((0.1, 0.43, 0.56))
    assert lines.clear((0, 1)) == pytest.approx((0.12, 0.42))
    assert lines.clear((1, 2)) == pytest.approx((0.44, 0.54))
    assert lines.cover((0, 1), 0.004) == pytest.approx((0.1, 0.428))


@pytest.mark.parametrize("handle", HANDLES, ids=lambda h: type(h).__name__)
@pytest.mark.parametrize("direction", ["level", "upright"])
def test_a_handle_stands_on_its_foot_and_fills_its_label(handle, direction):
    foot = np.array([-0.2, 0.1, 0.3])
    mounted = handle.mounted(foot, direction)
    own = _in_label_frame(mounted)
    assert np.ptp(own, axis=0)[[0, 2]] == pytest.approx(mounted.label.extents[[0, 2]], abs=1e-3)
    assert own[:, 1].max() == pytest.approx(mounted.label.extents[1] / 2, abs=1e-3)
    # Its lowest points are on the face, and it is centred on its foot.
    assert own[:, 1].min() == pytest.approx(-(foot - mounted.label.origin) @ -OUT, abs=1e-4)
    assert (own[:, 0].max() + own[:, 0].min()) == pytest.approx(0, abs=1e-4)
    assert (foot - mounted.label.origin)[1:] == pytest.approx([0, 0])
    thickness = mounted.label.extents[2]
    assert 0.008 <= thickness <= (0.035 if isinstance(handle, Knob) else 0.020)


@pytest.mark.parametrize("handle", HANDLES, ids=lambda h: type(h).__name__)
def test_a_handle_has_the_turns_of_its_label(handle):
    mounted = handle.mounted(np.zeros(3), "level")
    own = _in_label_frame(mounted)
    looks = trimesh.util.concatenate([s.surface() for s in mounted.portion.visual])
    looks.vertices = own
    for turn in mounted.label.symmetry.rotations:
        assert trimesh.proximity.closest_point(looks, own @ turn.T)[1].max() < 5e-4
    half_turn = np.diag([-1.0, 1.0, -1.0])
    away = trimesh.proximity.closest_point(looks, own @ half_turn)[1].max()
    assert (away > 3e-3) == (len(mounted.label.symmetry.rotations) == 1)


@pytest.mark.parametrize("handle", HANDLES[:3], ids=lambda h: type(h).__name__)
@pytest.mark.parametrize("direction", ["level", "upright"])
def test_the_labeller_finds_the_label_on_the_bare_mesh(handle, direction):
    mounted: Mounted = handle.mounted(np.array([-0.2, 0.1, 0.3]), direction)
    mesh = trimesh.util.concatenate([s.surface() for s in mounted.portion.visual])
    found = handle_label(mesh, OUT)
    distance, angle = pose_error(found.pose, mounted.label.pose, mounted.label.symmetry)
    assert distance < 0.003 and angle < np.deg2rad(2)


@pytest.mark.parametrize(
    "handle", [BarHandle(), BowHandle(), EdgePull()], ids=lambda h: type(h).__name__
)
def test_fingers_find_room_behind(handle):
    """25 mm are free behind what they close on."""
    mounted = handle.mounted(np.zeros(3), "level")
    behind = mounted.label.extents[1] / 2
    assert np.linalg.norm(mounted.label.origin) - behind >= 0.025
    point = mounted.label.origin - OUT * (behind + 0.012)
    for shape in mounted.portion.collision:
        mesh = shape.surface()
        offsets = np.einsum("fk,fk->f", mesh.face_normals, mesh.triangles[:, 0])
        assert (mesh.face_normals @ point - offsets).max() > 0.001


def _in_label_frame(mounted: Mounted) -> np.ndarray:
    points = [np.asarray(s.surface().vertices) for s in mounted.portion.visual]
    return transform(invert(mounted.label.pose), np.concatenate(points))


def _bounds(specimen: Specimen, name: str) -> np.ndarray:
    return next(body for body in specimen.bodies if body.name == name).surface().bounds


def _box(centre: np.ndarray, rotation: np.ndarray, half: np.ndarray) -> str:
    """A box that floats, as MJCF."""
    numbers = [" ".join(map(str, v)) for v in (centre, rotation_to_quaternion(rotation), half)]
    place = f'pos="{numbers[0]}" quat="{numbers[1]}"'
    # Contacts with the object, not with other probes.
    geom = f'<geom type="box" size="{numbers[2]}" contype="2" conaffinity="1"/>'
    return f"<body {place}><freejoint/>{geom}</body>"


def _forward(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def _files(folder):
    return sorted(path for path in folder.rglob("*") if path.is_file())
