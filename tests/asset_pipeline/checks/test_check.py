"""The checker passes what rests and names what does not."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import tests.asset_pipeline.labelled_assets as made
from asset_pipeline.build.emit import write_asset
from asset_pipeline.build.rigid import finish_rigid
from asset_pipeline.checks.asset_check import check, check_asset
from asset_pipeline.geometry.mass import shape_mass_properties
from manipose_mj.assets.asset import Asset, MovingPart, Provenance, StablePose
from manipose_mj.assets.geometry import Body, Joint, MassProperties, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.cli.main import main
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

HALF = (0.02, 0.03, 0.04)
UP = np.array([0.0, 0.0, 1.0])


def _label(extents) -> PoseLabel:
    rotation = np.array([[0.0, 0, 1], [0, 1, 0], [1, 0, 0]]) @ np.diag([1.0, 1, -1])
    return PoseLabel(
        np.zeros(3), rotation, "mirror", np.array(extents), SymmetryGroup.three_planes()
    )


def _box_body(**changes) -> Body:
    box = Shape(kind="box", size=HALF)
    body = Body("box", (box,), (box,), shape_mass_properties((box,), 500.0))
    return replace(body, **changes)


def _build(folder, body: Body) -> Asset:
    return finish_rigid(
        folder,
        name=folder.name,
        category="box",
        label=_label(2 * np.array(HALF)[[2, 1, 0]]),
        up=UP,
        body=body,
        provenance=Provenance("test", folder.name, "none"),
    )


@pytest.fixture(scope="module")
def box(tmp_path_factory) -> Asset:
    return _build(tmp_path_factory.mktemp("assets") / "box", _box_body())


def test_box_passes_with_its_numbers(box):
    (result,) = check(box.folder.parent)
    assert result.ok and result.failures == ()
    assert 0.05 < result.settle_seconds < 1.0
    assert result.penetration < 0.001 and result.tilt < np.deg2rad(1)
    assert (result.parts, result.part_vertices) == (1, 0)
    assert result.grasps == len(box.grasps) > 0
    assert check(box.folder) == [result]


def test_wrong_stable_pose_is_noticed(tmp_path, box):
    leaning = StablePose(rotation_about(np.array([1.0, 0, 0]), 0.6), 0.06, 1.0)
    wrong = replace(box, folder=tmp_path / "leaning", stable_poses=(leaning,), grasps=None)
    write_asset(wrong, (_box_body(),))
    (result,) = check(tmp_path)
    assert any("from the stable pose" in line for line in result.failures)


def test_rolling_ball_never_rests(tmp_path, box):
    ball = Shape(kind="sphere", size=(0.03,))
    off_center = shape_mass_properties((ball,), 500.0)
    body = Body("box", (ball,), (ball,), off_center, friction=(0.8, 0.0, 0.0))
    upright = StablePose(np.eye(3), 0.03, 1.0)
    wrong = replace(box, folder=tmp_path / "ball", stable_poses=(upright,), grasps=None)
    pushed = replace(
        body, mass_properties=replace(off_center, center_of_mass=np.array([0.02, 0.0, 0.0]))
    )
    write_asset(wrong, (pushed,))
    (result,) = check(tmp_path)
    assert not result.ok and "rest" in result.failures[0]


def test_too_many_vertices_are_named(tmp_path, box):
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.03)
    part = Shape(kind="mesh", mesh=mesh)
    wrong = replace(box, folder=tmp_path / "fine", grasps=None)
    write_asset(wrong, (_box_body(collision=(part,)),))
    (result,) = check(tmp_path)
    assert "162 vertices; at most 32" in result.failures[0]


def test_broken_folders_fail_without_stopping_the_others(tmp_path, box):
    _build(tmp_path / "good", _box_body())
    _build(tmp_path / "torn", _box_body()).folder.joinpath("asset.json").write_text("{")
    _build(tmp_path / "wild", _box_body()).model_path.write_text("<mujoco><nonsense/></mujoco>")
    results = {r.name: r for r in check(tmp_path, jobs=2)}
    assert results["good"].ok
    assert "not valid JSON" in results["torn"].failures[0]
    assert "does not compile" in results["wild"].failures[0]
    assert all("\n" not in line for r in results.values() for line in r.failures)


def test_folder_without_assets_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="holds no asset"):
        check(tmp_path)


def _cabinet(folder, box: Asset, joint: Joint, *, blocked: bool = False):
    """A shelf with one drawer that slides along -y, upright."""
    base = Shape(kind="box", size=(0.1, 0.1, 0.005))
    tray = Shape(
        kind="box", size=(0.08, 0.08, 0.02), pose=compose(np.eye(3), np.array([0, 0, 0.03]))
    )
    wall = Shape(
        kind="box", size=(0.1, 0.005, 0.05), pose=compose(np.eye(3), np.array([0, -0.16, 0]))
    )
    mass = MassProperties(0.5, np.array([0, 0, 0.03]), 1e-3 * np.eye(3))
    bodies = (
        Body("base", (base, wall) if blocked else (base,), (base,), replace(mass, mass=5.0)),
        Body("drawer", (tray,), (tray,), mass, joint=joint),
    )
    asset = replace(
        box,
        folder=folder,
        name="cabinet",
        kind="articulated",
        stable_poses=(),
        grasps=None,
        parts=(MovingPart("drawer", joint, None, None),),
    )
    write_asset(asset, bodies)
    return check_asset(folder)


def test_drawer_that_opens_and_stays_shut_passes(tmp_path, box):
    joint = Joint("slide", np.zeros(3), np.array([0.0, -1, 0]), (0.0, 0.15), 2.0, 5.0)
    assert _cabinet(tmp_path / "cabinet", box, joint).failures == ()


def test_drawer_that_falls_open_or_is_blocked_fails(tmp_path, box):
    down = Joint("slide", np.zeros(3), np.array([0.0, 0, -1]), (0.0, 0.15), 0.0, 0.5)
    falling = _cabinet(tmp_path / "falling", box, down)
    assert any("untouched" in line for line in falling.failures)
    joint = Joint("slide", np.zeros(3), np.array([0.0, -1, 0]), (0.0, 0.15), 2.0, 5.0)
    blocked = _cabinet(tmp_path / "blocked", box, joint, blocked=True)
    assert any("opens to" in line for line in blocked.failures)


def test_a_door_without_a_handle_is_a_remark_and_no_failure(tmp_path, capsys):
    cupboard = made.cupboard(tmp_path / "cupboard")
    remark = "door: no handle found; tasks that open it refuse it; say `parts: door: handle:`"
    (said,) = check_asset(cupboard.folder).remarks
    assert said.startswith(remark)
    main(["assets", "check", str(cupboard.folder)])
    assert f"cupboard: {remark} in labels.yaml" in capsys.readouterr().out
