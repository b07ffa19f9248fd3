"""The cabinet as a mechanism: shut parts stay shut, open easily, touch nothing, and hold things."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from asset_pipeline.procedural.articulated.cabinet import design, generate
from asset_pipeline.procedural.articulated.cabinets.kinds import DRAWERS
from asset_pipeline.procedural.articulated.handles.bar_handle import BarHandle
from manipose_mj.assets.asset import MovingPart
from manipose_mj.poses import rotation_about, transform
from tests.asset_pipeline.procedural.articulated_scene import all_ways, on_table, pull, touching

OPENING_FORCE = 15.0  # [N], what a Panda pulls with ease
CLOSING_FORCE = 20.0
CAN = '<geom name="can" type="cylinder" size=".0375 .125" mass=".205" condim="6" friction=".8 .005 .001"/>'
each = pytest.mark.parametrize("index", [0, 3])


def cabinet_model(index: int, folder: Path, extra: str = "") -> mujoco.MjModel:
    """The cabinet on a table."""
    return on_table(generate(index), folder, extra)


def moving_parts(index: int) -> tuple[MovingPart, ...]:
    parts = generate(index).parts
    assert [part.name for part in parts] == [*DRAWERS, "door"]
    return parts


@each
def test_untouched_it_stays_shut_and_touches_nothing(index, tmp_path):
    model = cabinet_model(index, tmp_path)
    data = mujoco.MjData(model)
    for _ in range(int(5 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        assert data.ncon == 0
    assert np.abs(data.qpos).max() < 1e-4


@each
def test_nothing_touches_anywhere_in_the_ranges(index, tmp_path):
    model = cabinet_model(index, tmp_path)
    assert touching(model, all_ways(4)) == []


@each
def test_parts_open_by_their_handles_under_a_bounded_force(index, tmp_path):
    model = cabinet_model(index, tmp_path)
    for part in moving_parts(index):
        data = mujoco.MjData(model)
        while data.time < 3.0:
            pull(model, data, part, OPENING_FORCE)
        assert data.joint(part.name).qpos[0] > 0.9 * part.joint.range[1], part.name
        others = [p.name for p in moving_parts(index) if p.name != part.name]
        assert all(abs(data.joint(name).qpos[0]) < 1e-4 for name in others)
        while data.time < 6.0:
            pull(model, data, part, -OPENING_FORCE)
        assert abs(data.joint(part.name).qpos[0]) < 2e-3, part.name


@each
def test_a_small_force_does_not_open_it(index, tmp_path):
    model = cabinet_model(index, tmp_path)
    for part in moving_parts(index):
        data = mujoco.MjData(model)
        while data.time < 0.5:
            pull(model, data, part, 0.5)
        # Without dry friction it would have come out by 25 mm, or 0.1 rad.
        assert data.joint(part.name).qpos[0] < 5e-3, part.name


@each
def test_open_parts_stay_where_they_are_left(index, tmp_path):
    model = cabinet_model(index, tmp_path)
    data = mujoco.MjData(model)
    data.qpos[:] = 0.6 * model.jnt_range[:, 1]
    mujoco.mj_step(model, data, 1000)
    assert data.qpos == pytest.approx(0.6 * model.jnt_range[:, 1], abs=1e-3)


@each
def test_a_lying_chips_can_rests_in_the_middle_drawer_and_is_shut_away(index, tmp_path):
    part = moving_parts(index)[1]
    cavity, opened = part.cavity, 0.95 * part.joint.range[1]
    low = cavity.center[2] - cavity.extents[2] / 2
    place = cavity.center[:2] + opened * part.joint.axis[:2]
    model = cabinet_model(
        index,
        tmp_path,
        f'<body name="can" pos="{place[0]} {place[1]} {low + 0.0395}" euler="90 0 0">'
        f"<freejoint/>{CAN}</body>",
    )
    data = mujoco.MjData(model)
    data.joint(part.name).qpos = opened
    while data.time < 1.0:
        mujoco.mj_step(model, data)
    assert data.body("can").xpos[2] == pytest.approx(low + 0.0375, abs=1e-3)
    assert np.linalg.norm(data.body("can").cvel) < 0.01
    drawer = data.joint(part.name)
    while data.time < 5.0:
        # As an arm shuts it: no faster than 0.15 m/s.
        shutting = drawer.qpos[0] > 1e-3 and drawer.qvel[0] > -0.15
        pull(model, data, part, -CLOSING_FORCE if shutting else 0.0)
    assert drawer.qpos[0] < 2e-3
    away = np.abs(data.body("can").xpos - cavity.center)
    half = np.array([0.0375, 0.125, 0.0375])
    assert (away + half <= cavity.extents / 2 + 2e-3).all()
    assert np.linalg.norm(data.body("can").cvel) < 0.02
    assert data.contact.dist.min() > -1e-3


@each
def test_a_ball_fits_every_cavity(index, tmp_path):
    spheres = "".join(
        f'<body pos="{" ".join(map(str, part.cavity.center))}"><freejoint/>'
        '<geom type="sphere" size=".03"/></body>'
        for part in moving_parts(index)
    )
    model = cabinet_model(index, tmp_path, spheres)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0


@each
def test_cavities_are_free_space_bounded_by_boards(index, tmp_path):
    """A box 1 mm smaller than a cavity touches nothing, one 20 mm larger does, on every side."""
    specimen = generate(index)
    for part in specimen.parts:
        center, extents = part.cavity.center, part.cavity.extents
        for grown, free in ((-0.001, True), (0.020, False)):
            box = " ".join(str(v / 2) for v in extents + grown)
            place = " ".join(map(str, center))
            folder = tmp_path / f"{part.name}{grown}"
            folder.mkdir()
            body = f'<body pos="{place}"><freejoint/><geom name="probe" type="box" size="{box}"/></body>'
            model = cabinet_model(index, folder, body)
            data = mujoco.MjData(model)
            mujoco.mj_forward(model, data)
            assert (data.ncon == 0) == free, part.name


@each
def test_drawers_take_a_lying_can_and_keep_low_walls(index):
    cabinet = design(index)
    assert cabinet.height <= 0.42 and 0.049 < cabinet.wall_height < 0.061
    for part in moving_parts(index)[:3]:
        depth, width, height = part.cavity.extents
        assert depth >= 0.24 and width >= 0.29 and height >= 0.10
        assert part.cavity.moves_with_part
        # Wide open, its back is still in the carcass.
        back = part.cavity.center[0] + depth / 2 + cabinet.wall
        assert back - part.joint.range[1] > -cabinet.depth / 2 + 0.005
    assert not moving_parts(index)[3].cavity.moves_with_part


@each
def test_handle_labels_follow_the_bars(index):
    handle: BarHandle = design(index).handle
    assert handle.standoff >= 0.035
    bodies = {body.name: body for body in generate(index).bodies}
    for part in moving_parts(index):
        label = part.handle
        lengths = [2 * max(shape.size) for shape in bodies[part.name].collision]
        bar = bodies[part.name].collision[int(np.argmin(np.abs(np.array(lengths) - handle.length)))]
        assert bar.pose[:3, 3] == pytest.approx(label.origin)
        corner = np.abs(label.rotation.T @ np.asarray(bar.size))
        assert corner == pytest.approx(label.extents / 2)
        assert label.rotation[:, 1] == pytest.approx([-1, 0, 0])
        assert np.linalg.det(label.rotation) == pytest.approx(1)
        assert label.rotation[2, 0 if part.name == "door" else 2] == pytest.approx(1)
        # Positive joint motion takes the handle outwards.
        before = label.origin
        if part.joint.kind == "slide":
            after = before + 0.01 * part.joint.axis
        else:
            turn = rotation_about(part.joint.axis, 0.05)
            after = turn @ (before - part.joint.origin) + part.joint.origin
        assert (after - before)[0] < -0.005


def test_panda_fingers_fit_around_the_handles(tmp_path):
    """A box as thick as a finger pad's tip goes around every bar, 10 mm past its middle."""
    for part in moving_parts(0):
        probes = ""
        for side in (-1, 1):
            point = transform(part.handle.pose, np.array([[0.0, -0.0005, side * 0.019]]))[0]
            x, y, z = part.handle.rotation.T
            axes = " ".join(map(str, (*x, *y)))
            probes += (
                f'<body pos="{" ".join(map(str, point))}" xyaxes="{axes}"><freejoint/>'
                '<geom type="box" size="0.0105 0.0095 0.0125"/></body>'
            )
        folder = tmp_path / part.name
        folder.mkdir()
        model = cabinet_model(0, folder, probes)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert data.ncon == 0, part.name
