"""The asset folder: written, read back, refused with one line when a field is wrong, all or nothing."""

from __future__ import annotations

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from asset_pipeline.build import emit
from asset_pipeline.build.emit import write_asset
from manipose_mj.assets import asset_json
from manipose_mj.assets.asset import (
    ASSET_FILE,
    GRASPS_FILE,
    MODEL_FILE,
    Asset,
    Cavity,
    GraspSet,
    MovingPart,
    Provenance,
    StablePose,
)
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.assets.geometry import Body, Joint, MassProperties, Shape
from manipose_mj.assets.label import PoseLabel, symmetry_from_bop, symmetry_to_bop
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, compose, rotation_about
from manipose_mj.storage.cache_root import CACHE_VARIABLE

TURN = rotation_about(np.array([0.6, 0.0, 0.8]), 0.7)
MASS = MassProperties(0.5, np.array([0.01, 0.0, -0.02]), np.diag([1e-3, 2e-3, 2.5e-3]))


def _label(symmetry: SymmetryGroup | None = None) -> PoseLabel:
    group = SymmetryGroup.three_planes() if symmetry is None else symmetry
    return PoseLabel(np.array([0.1, -0.2, 0.3]), TURN, "mirror", np.array([0.1, 0.2, 0.3]), group)


def _rigid(folder: Path) -> Asset:
    grasps = GraspSet(
        poses=compose(np.stack([TURN, TURN.T]), np.array([[0.0, 0.1, 0.2], [0.3, 0.0, 0.0]])),
        widths=np.array([0.05, 0.07]),
        clear=np.array([[True], [False]]),
        held=1,
        tried=3,
    )
    return Asset(
        folder, "block", "rigid", "box", _label(), np.array([0.0, 0.0, 1.0]), MASS,
        (StablePose(TURN, 0.04, 1.0),), Provenance("test", "block", "none", {"a.obj": "0" * 64}),
        grasps=grasps,
    )  # fmt: skip


def _cupboard(folder: Path) -> Asset:
    axis = np.array([1.0, 0.0, 0.0])
    drawer = MovingPart(
        "drawer",
        Joint("slide", np.zeros(3), axis, (0.0, 0.3), frictionloss=1.5, damping=2.0),
        _label(SymmetryGroup.identity()),
        Cavity(np.array([0.0, 0.0, 0.1]), np.array([0.2, 0.3, 0.1]), moves_with_part=True),
    )
    door = MovingPart("door", Joint("hinge", axis, axis[[2, 1, 0]], (0.0, 1.5)), None, None)
    return replace(
        _rigid(folder), name="cupboard", kind="articulated", grasps=None, parts=(drawer, door)
    )


def _bodies(asset: Asset) -> tuple[Body, ...]:
    shape = (Shape(kind="box", size=(0.05, 0.1, 0.15)),)
    parts = [Body(p.name, shape, shape, MASS, joint=p.joint) for p in asset.parts]
    return (Body("base", shape, shape, MASS), *parts)


def _write(asset: Asset) -> Asset:
    return write_asset(asset, _bodies(asset))


def _same_label(a: PoseLabel, b: PoseLabel) -> None:
    np.testing.assert_allclose(a.pose, b.pose, atol=1e-8)
    np.testing.assert_allclose(a.extents, b.extents, atol=1e-8)
    np.testing.assert_allclose(a.symmetry.rotations, b.symmetry.rotations, atol=1e-7)
    assert (a.object_type, a.symmetry.axial) == (b.object_type, b.symmetry.axial)


def test_a_rigid_asset_reads_back_as_written(tmp_path):
    asset = _rigid(tmp_path / "block")
    back = _write(asset)
    assert read_asset(str(asset.folder)).name == "block"
    assert (back.name, back.kind, back.category) == ("block", "rigid", "box")
    assert back.provenance == asset.provenance
    _same_label(back.label, asset.label)
    np.testing.assert_allclose(back.up, asset.up)
    np.testing.assert_allclose(back.stable_poses[0].pose, asset.stable_poses[0].pose, atol=1e-8)
    assert back.mass_properties.mass == MASS.mass
    np.testing.assert_allclose(back.mass_properties.center_of_mass, MASS.center_of_mass)
    np.testing.assert_array_equal(back.mass_properties.inertia, MASS.inertia)
    assert asset.grasps is not None and back.grasps is not None
    np.testing.assert_allclose(back.grasps.poses, asset.grasps.poses, atol=5e-6)
    np.testing.assert_allclose(back.grasps.widths, asset.grasps.widths)
    np.testing.assert_array_equal(back.grasps.clear, asset.grasps.clear)
    assert back.grasps.clear.dtype == bool
    assert (back.grasps.held, back.grasps.tried, back.grasps.graspable) == (1, 3, False)
    assert list_assets(tmp_path) == [asset.folder]


def test_an_articulated_asset_reads_back_as_written(tmp_path):
    asset = _cupboard(tmp_path / "cupboard")
    back = _write(asset)
    assert back.grasps is None
    assert [p.name for p in back.parts] == ["drawer", "door"]
    for own, read in zip(asset.parts, back.parts, strict=True):
        np.testing.assert_allclose(read.joint.origin, own.joint.origin)
        np.testing.assert_allclose(read.joint.axis, own.joint.axis)
        assert (read.joint.kind, read.joint.range) == (own.joint.kind, own.joint.range)
        assert read.joint.frictionloss == own.joint.frictionloss
        assert read.joint.damping == own.joint.damping
    drawer, door = back.parts
    assert drawer.handle is not None and drawer.cavity is not None and drawer.cavity.moves_with_part
    np.testing.assert_allclose(drawer.cavity.extents, [0.2, 0.3, 0.1])
    assert door.handle is None and door.cavity is None
    with pytest.raises(InputError, match="no moving part 'lid'.*drawer, door"):
        back.part("lid")


def test_errors_name_a_folder_of_ones_own_and_a_built_in_object(tmp_path, monkeypatch):
    """The folder of what is built in is the cache's: nobody chose it, and it tells nothing."""
    own = _cupboard(tmp_path / "assets" / "cupboard")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    built_in = replace(own, folder=tmp_path / "cache" / "catalogue" / "cabinet-0" / own.name)
    for asset, place in ((own, str(own.folder)), (built_in, own.name)):
        with pytest.raises(InputError, match=f"^{re.escape(place)}: no moving part"):
            asset.part("lid")


def test_the_model_loads_alone_from_a_moved_folder_with_the_mass_that_is_said(tmp_path):
    _write(_cupboard(tmp_path / "cupboard"))
    moved = tmp_path / "elsewhere" / "renamed"
    shutil.copytree(tmp_path / "cupboard", moved)
    model = mujoco.MjModel.from_xml_path(str(moved / MODEL_FILE))
    assert model.njnt == 2 and model.nbody == 4
    assert model.body_mass[1:] == pytest.approx(MASS.mass)
    assert read_asset(moved).name == "cupboard"


@pytest.mark.parametrize(
    "group",
    [
        SymmetryGroup.identity(),
        SymmetryGroup.about_x(),
        SymmetryGroup.about_x(ends_alike=True),
        SymmetryGroup.two_planes(),
        SymmetryGroup.three_planes(),
        SymmetryGroup.generated(rotation_about(np.array([1.0, 0, 0]), np.pi / 2)[None]),
    ],
)
def test_symmetries_survive_the_bop_form(group):
    label = _label(group)
    stored = json.loads(json.dumps(symmetry_to_bop(label, group)))
    assert len(stored["symmetries_discrete"]) == len(group.rotations) - 1
    for matrix in stored["symmetries_discrete"]:  # BOP's matrices map the mesh onto itself
        turned = np.reshape(matrix, (4, 4)) @ [*label.origin, 1.0]
        np.testing.assert_allclose(turned[:3], label.origin, atol=1e-12)
    back = symmetry_from_bop(label.rotation, **{k[11:]: v for k, v in stored.items()})
    np.testing.assert_allclose(back.rotations, group.rotations, atol=1e-12)
    assert back.axial == group.axial


@pytest.mark.parametrize("printed", [None, SymmetryGroup.identity(), SymmetryGroup.two_planes()])
def test_the_groups_of_shape_and_of_shape_and_print_are_kept_side_by_side(tmp_path, printed):
    asset = _rigid(tmp_path / "block")
    back = _write(replace(asset, label=replace(asset.label, print_symmetry=printed))).label
    assert len(back.symmetry.rotations) == 4
    assert len(back.symmetry_textured.rotations) == (
        4 if printed is None else len(printed.rotations)
    )
    assert (back.print_symmetry is None) == (printed is None)


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("assets")
    _write(_rigid(folder / "block"))
    _write(_cupboard(folder / "cupboard"))
    return folder


MIRROR = [float(v) for v in np.diag([1.0, 1.0, -1.0, 1.0]).ravel()]
DELETED = object()
# Asset, where in its JSON, the value put there, and what the message must name.
BAD_FIELDS = [
    ("block", "schema_version", 99, "schema_version"),
    ("block", "schema_version", True, "schema_version"),
    ("block", "schema_version", DELETED, "schema_version"),
    ("block", "kind", "soft", "kind"),
    ("block", "name", 3, "name"),
    ("block", "name", "", "'name' is ''; expected a name without /"),
    ("block", "name", "a/b", "'name' is 'a/b'; expected a name without /"),
    ("block", "up", [0, 0, 0], "'up' is [0, 0, 0]; expected a unit vector"),
    ("block", "stable_poses", [], "'stable_poses' is []"),
    ("block", "label", [], "label"),
    ("block", "label.object_type", "round", "label.object_type"),
    ("block", "label.rotation", np.diag([1.0, 1, -1]).tolist(), "label.rotation"),
    ("block", "label.rotation", (2 * np.eye(3)).tolist(), "label.rotation"),
    ("block", "label.rotation", [[1, 0], [0, 1]], "label.rotation"),
    ("block", "label.origin", [0.0, math.nan, 0.0], "label.origin"),
    ("block", "label.extents", [0.1, "wide", 0.1], "label.extents"),
    ("block", "label.extents", [0.1, -0.1, 0.1], "label.extents"),
    ("block", "label.symmetries_discrete", [MIRROR], "label.symmetries_"),
    ("block", "label.symmetries_discrete", [[1.0] * 15], "label.symmetries_"),
    ("block", "label.symmetries_continuous", [{"axis": [0, 0, 1]}], "label.symmetries_"),
    ("block", "label.symmetries_continuous", [{}], "label.symmetries_"),
    ("block", "label.symmetries_discrete_textured", [MIRROR], "symmetries_*_textured"),
    ("block", "label.symmetries_discrete_textured", DELETED, "symmetries_discrete_textured"),
    ("block", "label.symmetries_continuous_textured", [{"axis": [0, 0, 1]}], "_textured"),
    ("block", "mass_properties.mass", -0.1, "mass_properties.mass"),
    ("block", "mass_properties.mass", 0, "mass_properties.mass"),
    ("block", "mass_properties.mass", math.inf, "mass_properties.mass"),
    ("block", "mass_properties.inertia", (-np.eye(3)).tolist(), "mass_properties.inertia"),
    ("block", "mass_properties.inertia", [1, 2, 3], "mass_properties.inertia"),
    ("block", "stable_poses.0.quaternion", [1, 1, 0, 0], "stable_poses[0].quaternion"),
    ("block", "stable_poses.0.height", math.nan, "stable_poses[0].height"),
    ("block", "stable_poses.0", 4, "stable_poses[0]"),
    ("block", "provenance.licence", DELETED, "provenance.licence"),
    ("cupboard", "parts.0.joint.type", "ball", "parts[0].joint.type"),
    ("cupboard", "parts.0.joint.range", [0.3, 0.0], "parts[0].joint.range"),
    ("cupboard", "parts.0.joint.range", [0.0], "parts[0].joint.range"),
    ("cupboard", "parts.1.joint.axis", [0, 0, 2], "parts[1].joint.axis"),
    ("cupboard", "parts.1.joint.damping", "high", "parts[1].joint.damping"),
    ("cupboard", "parts.0.handle", 5, "parts[0].handle"),
    ("cupboard", "parts.0.handle.rotation", np.zeros((3, 3)).tolist(), "parts[0].handle.rotation"),
    ("cupboard", "parts.0.cavity", "big", "parts[0].cavity"),
    ("cupboard", "parts.0.cavity.extents", [1, 1], "parts[0].cavity.extents"),
    ("cupboard", "parts.1", None, "parts[1]"),
]  # fmt: skip


def _change(document, where: str, value) -> None:
    *path, last = [int(k) if k.isdigit() else k for k in where.split(".")]
    for key in path:
        document = document[key]
    if value is DELETED:
        del document[last]
    else:
        document[last] = value


@pytest.mark.parametrize(("asset", "where", "value", "named"), BAD_FIELDS)
def test_a_wrong_field_is_one_line_with_file_and_field(
    written, tmp_path, asset, where, value, named
):
    folder = tmp_path / asset
    shutil.copytree(written / asset, folder)
    document = json.loads((folder / ASSET_FILE).read_text())
    _change(document, where, value)
    (folder / ASSET_FILE).write_text(json.dumps(document))
    _refused(folder, ASSET_FILE, named)


BAD_GRASPS = [
    ("widths", ["wide", 0.07], "widths"),
    ("widths", [math.nan, 0.07], "widths"),
    ("widths", 0.05, "widths"),
    ("widths", [0.05], "poses"),
    ("poses", [[0.0] * 12], "poses"),
    ("poses", [[0.0] * 7] * 2, "poses"),
    ("held", 3, "held"),
    ("held", "all", "held"),
    ("tried", 0, "tried"),
    ("tried", True, "tried"),
    ("clear", [[1, 1], [0, 0]], "clear"),
]


def test_grasps_that_nobody_tried_are_not_said_to_fail(written, tmp_path):
    folder = tmp_path / "block"
    shutil.copytree(written / "block", folder)
    document = json.loads((folder / GRASPS_FILE).read_text())
    del document["tried"]
    (folder / GRASPS_FILE).write_text(json.dumps(document))
    grasps = read_asset(folder).grasps
    assert grasps is not None and grasps.graspable is None and (grasps.held, len(grasps)) == (0, 2)


@pytest.mark.parametrize(("field", "value", "named"), BAD_GRASPS)
def test_wrong_grasps_are_one_line_with_file_and_field(written, tmp_path, field, value, named):
    folder = tmp_path / "block"
    shutil.copytree(written / "block", folder)
    document = json.loads((folder / GRASPS_FILE).read_text())
    document[field] = value
    (folder / GRASPS_FILE).write_text(json.dumps(document))
    _refused(folder, GRASPS_FILE, named)


@pytest.mark.parametrize(
    ("text", "named"),
    [(b"{", "JSON"), (b"[1]", "list"), (b"\xff\xfe", "JSON"), (b"", "JSON"), (None, "missing")],
)
def test_a_file_that_is_no_asset_is_named(written, tmp_path, text, named):
    folder = tmp_path / "block"
    shutil.copytree(written / "block", folder)
    if text is None:
        (folder / ASSET_FILE).unlink()
    else:
        (folder / ASSET_FILE).write_bytes(text)
    _refused(folder, ASSET_FILE, named)


def test_a_folder_without_its_model_is_refused(written, tmp_path):
    shutil.copytree(written / "block", tmp_path / "block")
    (tmp_path / "block" / MODEL_FILE).unlink()
    _refused(tmp_path / "block", MODEL_FILE, "missing")


def test_folders_without_assets_are_named(tmp_path):
    with pytest.raises(InputError, match="nowhere: no such folder"):
        list_assets(tmp_path / "nowhere")
    with pytest.raises(InputError, match="holds no asset"):
        list_assets(tmp_path)


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (
            ("mass_properties", "mass"),
            "heavy",
            "'mass_properties.mass' is 'heavy'; expected a finite",
        ),
        (
            ("label", "extents"),
            [1, 0, 1],
            "'label.extents' is [1, 0, 1]; expected 3 positive lengths",
        ),
        (
            ("parts", 1, "joint", "type"),
            "screw",
            "'parts[1].joint.type' is 'screw'; expected 'slide' or",
        ),
        (("parts", 0, "handle"), "none", "'parts[0].handle' is 'none'; expected an object"),
        (("areas",), {}, "'areas' is {}; expected a list"),
    ],
)
def test_a_complaint_says_what_stands_there_and_what_would_be_right(tmp_path, place, value, said):
    _write(_cupboard(tmp_path / "cupboard"))
    path = tmp_path / "cupboard" / "asset.json"
    document = inner = json.loads(path.read_text())
    *way, last = place
    for key in way:
        inner = inner[key]
    inner[last] = value
    path.write_text(json.dumps(document))
    _refused(tmp_path / "cupboard", "asset.json", said)


def _refused(folder: Path, file: str, named: str) -> None:
    with pytest.raises(InputError) as caught:
        read_asset(folder)
    message = str(caught.value)
    assert str(folder / file) in message
    assert named in message
    assert "\n" not in message


@pytest.mark.parametrize("fails", ["asset.json", "model", "rename"])
def test_a_write_that_fails_leaves_the_old_folder_and_nothing_else(tmp_path, monkeypatch, fails):
    asset = _rigid(tmp_path / "block")
    _write(asset)
    before = {p: p.read_bytes() for p in asset.folder.rglob("*") if p.is_file()}

    def full(*_args, **_kwargs):
        raise OSError(28, "No space left on device")

    if fails == "asset.json":
        monkeypatch.setattr(asset_json, "write_json", full)
    elif fails == "model":
        monkeypatch.setattr(emit, "model_element", full)
    else:
        monkeypatch.setattr(emit, "put_in_place", full)
    with pytest.raises(OSError, match="No space"):
        _write(replace(asset, category="other"))
    assert {p: p.read_bytes() for p in asset.folder.rglob("*") if p.is_file()} == before
    assert [p.name for p in tmp_path.iterdir()] == ["block"]


def test_a_second_write_replaces_the_folder_whole(tmp_path):
    asset = _rigid(tmp_path / "block")
    _write(asset)
    (asset.folder / "meshes" / "stale.obj").write_text("old")
    back = _write(replace(asset, category="other", grasps=None))
    assert back.category == "other" and back.grasps is None
    assert not (asset.folder / "meshes" / "stale.obj").exists()
    assert [p.name for p in tmp_path.iterdir()] == ["block"]
