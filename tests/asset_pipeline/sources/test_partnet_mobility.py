"""PartNet-Mobility, from its folder to an asset that opens and holds a ball: a small one drawn here, and
some of the real ones where they are."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from asset_pipeline.build.articulated import build_articulated
from asset_pipeline.build.data_set import build
from asset_pipeline.checks.asset_check import check_asset
from asset_pipeline.checks.cavity_check import takes_ball
from asset_pipeline.sources.partnet_mobility import objects as partnet_mobility
from asset_pipeline.sources.partnet_mobility.urdf import read_urdf
from manipose_mj.errors import InputError
from tests.places import REAL_DATA

ARCHIVE = REAL_DATA / "partnet_mobility.tar.xz"
REAL = ("46408", "46236", "7236")  # a flap, a door and a drawer, a microwave of sheets
needs_data = pytest.mark.skipif(
    not ARCHIVE.is_file(),
    reason=f"no {ARCHIVE}; set MANIPOSE_REAL_DATA to a folder with partnet_mobility.tar.xz",
)

# In the publisher's frame: y up, the front towards +z, no unit (here 1 = 0.42 m / 1.0 of depth).
# Name of the part, lowest and highest corner.
Boards = list[tuple[str, tuple[float, float, float], tuple[float, float, float]]]
BASE: Boards = [
    ("vertical_side_panel-1", (-0.60, -0.60, -0.50), (-0.56, 0.60, 0.46)),
    ("vertical_side_panel-2", (0.56, -0.60, -0.50), (0.60, 0.60, 0.46)),
    ("bottom_panel-3", (-0.56, -0.60, -0.50), (0.56, -0.56, 0.46)),
    ("top_panel-4", (-0.56, 0.56, -0.50), (0.56, 0.60, 0.46)),
    ("shelf-5", (-0.56, -0.02, -0.50), (0.56, 0.02, 0.46)),
    ("back_panel-6", (-0.56, -0.56, -0.50), (0.56, 0.56, -0.49)),
]
# The door is drawn shut, hinged on the viewer's right (x = 0.6), overlapping the sides by 0.01.
DOOR: Boards = [
    ("cabinet_door_surface-7", (-0.60, 0.0, 0.45), (0.60, 0.60, 0.50)),
    ("handle-8", (-0.52, 0.15, 0.56), (-0.49, 0.45, 0.59)),
    ("handle-8", (-0.52, 0.17, 0.50), (-0.49, 0.20, 0.56)),
    ("handle-8", (-0.52, 0.40, 0.50), (-0.49, 0.43, 0.56)),
]
# The drawer is drawn half open: 0.3 out of 0.7; its lower limit is shut.
DRAWER: Boards = [
    ("drawer_front-9", (-0.60, -0.58, 0.75), (0.60, -0.05, 0.80)),
    ("drawer_side-10", (-0.54, -0.54, -0.10), (-0.51, -0.20, 0.75)),
    ("drawer_side-11", (0.51, -0.54, -0.10), (0.54, -0.20, 0.75)),
    ("drawer_back-12", (-0.51, -0.54, -0.10), (0.51, -0.20, -0.07)),
    ("drawer_bottom-13", (-0.51, -0.54, -0.07), (0.51, -0.51, 0.75)),
]
KNOB: Boards = [("knob-14", (0.30, 0.58, 0.40), (0.36, 0.64, 0.46))]
LINKS = {"link_0": DOOR, "link_1": DRAWER, "link_2": KNOB, "link_3": BASE}
JOINTS = """
<joint name="joint_3" type="fixed"><origin rpy="1.570796326794897 0 -1.570796326794897" xyz="0 0 0"/>
  <child link="link_3"/><parent link="base"/></joint>
<joint name="joint_0" type="revolute"><origin xyz="0.6 0 0.5"/><axis xyz="0 1 0"/><child link="link_0"/>
  <parent link="link_3"/><limit lower="0" upper="1.5707963"/></joint>
<joint name="joint_1" type="prismatic"><origin xyz="0 0 0"/><axis xyz="0 0 1"/><child link="link_1"/>
  <parent link="link_3"/><limit lower="-0.3" upper="0.4"/></joint>
<joint name="joint_2" type="continuous"><origin xyz="0.33 0.61 0.46"/><axis xyz="0 0 1"/>
  <child link="link_2"/><parent link="link_3"/></joint>
"""
ORIGINS = {"link_0": (0.6, 0, 0.5), "link_2": (0.33, 0.61, 0.46)}
SCALE = 0.42 / 1.0  # cabinets are 0.42 m deep, with the door and without the handle


@pytest.fixture
def drawn(tmp_path) -> Path:
    """An object as PartNet-Mobility publishes it: a carcass with a door above a drawer, and a knob."""
    folder = tmp_path / "dataset" / "4711"
    (folder / "textured_objs").mkdir(parents=True)
    links, count = ['<link name="base"/>'], 0
    for link, boards in LINKS.items():
        visuals = []
        back = " ".join(f"{-v:g}" for v in ORIGINS.get(link, (0, 0, 0)))
        for name, low, high in boards:
            file = f"textured_objs/original-{count}.obj"
            box = trimesh.creation.box(bounds=[low, high])
            lines = ["mtllib original.mtl", "usemtl red"]
            lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in box.vertices]
            lines += [f"f {a}// {b}// {c}//" for a, b, c in box.faces + 1]
            (folder / file).write_text("\n".join(lines) + "\n")
            geometry = f'<geometry><mesh filename="{file}"/></geometry>'
            visuals.append(f'<visual name="{name}"><origin xyz="{back}"/>{geometry}</visual>')
            count += 1
        links.append(f'<link name="{link}">{"".join(visuals)}</link>')
    urdf = f'<?xml version="1.0" ?><robot name="drawn">{"".join(links)}{JOINTS}</robot>'
    (folder / "mobility.urdf").write_text(urdf)
    (folder / "textured_objs" / "original.mtl").write_text(
        "newmtl red\nKd 0.8 0.1 0.1\nd 0.9\nmap_Kd /etc/../home/someone/wood.jpg\n"
    )
    (folder / "semantics.txt").write_text(
        "link_0 hinge rotation_door\nlink_1 slider drawer\nlink_2 hinge knob\n"
        "link_3 heavy furniture_body\n"
    )
    (folder / "meta.json").write_text(json.dumps({"model_cat": "StorageFurniture"}))
    (folder / "mobility_v2.json").write_text(
        json.dumps([{"id": 0, "jointData": {"limit": {"a": 0, "b": 90, "noLimit": False}}}])
    )
    return folder


def read(folder: Path):
    (item,) = partnet_mobility.items(folder)
    with partnet_mobility.opened(item) as scan:
        return scan


@pytest.fixture
def asset(drawn, tmp_path):
    return build_articulated(read(drawn), tmp_path / "asset")


def test_reader_gives_metres_and_shut_parts_opening_towards_the_viewer(drawn):
    scan = read(drawn)
    assert (scan.name, scan.category) == ("4711", "cabinet")
    assert [link.name for link in scan.moving] == ["door_0", "drawer_1", "knob_2"]
    boards = np.array([p.mesh.bounds for p in scan.base.parts])
    low, high = boards[:, 0].min(axis=0), boards[:, 1].max(axis=0)
    np.testing.assert_allclose(high - low, [0.96 * SCALE, 1.2 * SCALE, 1.2 * SCALE], atol=1e-6)
    np.testing.assert_allclose([*(low + high)[:2], low[2]], 0, atol=1e-6)
    door, drawer, knob = (link.joint for link in scan.moving)
    np.testing.assert_allclose(door.axis, [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(door.origin[1], -0.6 * SCALE, atol=1e-6)  # the viewer's right
    np.testing.assert_allclose(drawer.axis, [-1, 0, 0], atol=1e-9)
    assert drawer.travel == pytest.approx(0.7 * SCALE)
    assert knob.travel == pytest.approx(2 * np.pi) and knob.kind == "hinge"
    front = next(p for p in scan.moving[1].parts if p.name == "drawer_front").mesh
    panel = next(p for p in scan.moving[0].parts if p.name == "cabinet_door_surface").mesh
    np.testing.assert_allclose(front.bounds[:, 0], panel.bounds[:, 0], atol=1e-6)  # shut, flush
    assert scan.base.parts[0].surfaces[0].rgba == (0.8, 0.1, 0.1, 0.9)
    assert scan.base.parts[0].surfaces[0].texture is None  # it was outside the folder


def test_limits_whose_upper_end_is_shut_are_reversed(drawn):
    urdf = drawn / "mobility.urdf"
    text = urdf.read_text().replace('<axis xyz="0 0 1"/><child link="link_1"/>',
                                    '<axis xyz="0 0 -1"/><child link="link_1"/>')  # fmt: skip
    urdf.write_text(text.replace('lower="-0.3" upper="0.4"', 'lower="-0.4" upper="0.3"'))
    drawer = read(drawn).moving[1].joint
    np.testing.assert_allclose(drawer.axis, [-1, 0, 0], atol=1e-9)
    assert drawer.travel == pytest.approx(0.7 * SCALE)


DOOR_LIMIT, DRAWER_LIMIT = 'lower="0" upper="1.5707963"', 'lower="-0.3" upper="0.4"'


def with_limit(drawn: Path, before: str, after: str) -> Path:
    urdf = drawn / "mobility.urdf"
    urdf.write_text(urdf.read_text().replace(before, after))
    return drawn


def test_a_door_that_swings_both_ways_is_shut_as_drawn(drawn, caplog):
    whole = read(drawn)
    both = read(with_limit(drawn, DOOR_LIMIT, 'lower="-1.5" upper="1.5707963"'))
    assert "'link_0' moves to both sides of where it is drawn: taken to be shut" in caplog.text
    for one, other in zip(whole.moving, both.moving, strict=True):
        np.testing.assert_allclose(one.joint.axis, other.joint.axis, atol=1e-9)
        assert one.joint.travel == other.joint.travel


def test_ranges_that_nothing_has_are_refused(drawn):
    with pytest.raises(InputError, match="'link_1' slides by 9.69 m, farther than the object"):
        read(with_limit(drawn, DRAWER_LIMIT, 'lower="0" upper="30"'))
    with pytest.raises(InputError, match="'link_0' turns from 0 to 90 rad; .* degrees?"):
        read(with_limit(drawn, DOOR_LIMIT, 'lower="0" upper="90"'))


def test_ranges_that_are_odd_are_told(drawn, caplog):
    read(with_limit(drawn, DOOR_LIMIT, 'lower="0.5" upper="1.5"'))
    assert "'link_0' is never as shut as it is drawn: it moves from 0.5 to 1.5" in caplog.text
    (drawn / "meta.json").write_text(json.dumps({"model_cat": "Microwave"}))
    read(drawn)
    assert "the category is Microwave, but the body that of StorageFurniture" in caplog.text


def test_boards_become_exact_boxes_and_overlapping_parts_do_not_jam(asset):
    result = check_asset(asset.folder)
    assert result.ok, result.failures
    assert result.parts == len(BASE) + len(DOOR) + len(DRAWER) + len(KNOB)
    assert result.part_vertices == 0  # no mesh at all
    model = asset.model_path.read_text()
    assert '<exclude body1="door_0" body2="base" />' in model


def test_handle_label_sits_on_the_bar(asset):
    handle = asset.part("door_0").handle
    # In the object frame: x = -z, y = -x, z = y of the drawing, from the middle of the base's foot.
    middle = SCALE * np.array([-(0.575 + 0.02), 0.505, 0.3 + 0.6])
    np.testing.assert_allclose(handle.origin, middle, atol=1e-3)
    np.testing.assert_allclose(handle.rotation[:, 0], [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(handle.rotation[:, 1], [-1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(handle.extents, SCALE * np.array([0.3, 0.03, 0.03]), atol=1e-3)
    assert len(handle.symmetry.rotations) == 2
    assert asset.part("drawer_1").handle is None


def test_cavities_are_the_free_boxes_and_hold_a_ball(asset):
    shelf, drawer = asset.part("door_0").cavity, asset.part("drawer_1").cavity
    assert not shelf.moves_with_part and drawer.moves_with_part
    np.testing.assert_allclose(shelf.extents, SCALE * np.array([0.94, 1.12, 0.54]), atol=0.012)
    np.testing.assert_allclose(drawer.extents[:2], SCALE * np.array([0.82, 1.02]), atol=0.012)
    floor = drawer.center[2] - drawer.extents[2] / 2
    assert floor == pytest.approx(SCALE * (0.6 - 0.51), abs=0.006)
    assert asset.part("knob_2").cavity is None
    for name in ("door_0", "drawer_1"):
        assert takes_ball(asset, asset.part(name)) == ""


def test_ball_test_notices_a_barred_cavity(drawn, tmp_path):
    """The check must be able to fail: a grating across the opening, which the labels do not know of."""
    asset = build_articulated(read(drawn), tmp_path / "asset")
    bars = "".join(
        f'<geom type="box" size=".004 .004 .25" pos="-.21 {y:.2f} .25"/>'
        for y in np.arange(-0.25, 0.26, 0.04)
    )
    text = asset.model_path.read_text()
    asset.model_path.write_text(text.replace("<worldbody>", f"<worldbody>{bars}", 1))
    assert "stopped" in takes_ball(asset, asset.part("door_0"))


def test_missing_mesh_is_skipped_until_a_link_has_none(drawn, caplog):
    (drawn / "textured_objs" / "original-0.obj").unlink()  # the door's panel
    assert len(read(drawn).moving[0].parts) == 1
    assert "original-0.obj" in caplog.text
    (drawn / "textured_objs" / "original-1.obj").write_text("v 0 0 0\nl 1 1\n")  # only a line
    for index in range(2, len(DOOR)):
        (drawn / "textured_objs" / f"original-{index}.obj").unlink()
    with pytest.raises(InputError, match="none of the 4 meshes of link 'link_0'"):
        read(drawn)


BAD = {
    "entities": (
        '<?xml version="1.0" ?>',
        '<?xml version="1.0" ?><!DOCTYPE x [<!ENTITY a "b"><!ENTITY c "&a;&a;">]>',
        "document type",
    ),
    "escape": ("textured_objs/original-3.obj", "../../../etc/passwd", "leaves the folder"),
    "absolute": ("textured_objs/original-3.obj", "/etc/passwd", "leaves the folder"),
    "cycle": ('<child link="link_3"/><parent link="base"/>',
              '<child link="link_3"/><parent link="link_0"/>', "cycle"),
    "forest": ('<link name="base"/>', '<link name="base"/><link name="loose"/>', "hang on nothing"),
    "two parents": ('<child link="link_1"/>', '<child link="link_0"/>', "hangs on two joints"),
    "unknown link": ('<child link="link_1"/>', '<child link="link_9"/>', "'link_9'"),
    "no number": ('lower="-0.3"', 'lower="shut"', "'shut'"),
    "infinite": ('<origin xyz="0.6 0 0.5"/>', '<origin xyz="inf 0 0.5"/>', "finite"),
    "joint type": ('"revolute"', '"Revolute"', "unknown type of a joint 'Revolute'; did you mean"),
    "degrees": ('rpy="1.570796326794897 0 ', 'rpy="90 0 ', "turned by 90 0 -1.5708 rad; .*degrees"),
    "limits crossed": ('lower="-0.3"', 'lower="7"', "order"),
    "not XML": ("</robot>", "", "not XML"),
    "scale": ('obj"/>', 'obj" scale="0.001 0.001 0.001"/>', "has scale '0.001"),
    "scale of words": ('obj"/>', 'obj" scale="one"/>', "has scale 'one'"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_urdf_is_refused_in_one_line(case, drawn):
    old, new, message = BAD[case]
    urdf = drawn / "mobility.urdf"
    assert old in urdf.read_text()
    urdf.write_text(urdf.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=message) as caught:
        read_urdf(urdf)
    assert str(urdf) in str(caught.value) and "\n" not in str(caught.value)


def test_scales_of_one_are_none_and_joints_that_follow_others_are_told(drawn, caplog):
    urdf = drawn / "mobility.urdf"
    plain, text = read_urdf(urdf), urdf.read_text()
    text = text.replace('obj"/>', 'obj" scale="1.0 1 1.00"/>')
    urdf.write_text(text.replace("</joint>", '<mimic joint="joint_0"/></joint>', 2))
    assert read_urdf(urdf).visuals.keys() == plain.visuals.keys()
    told = [each.getMessage() for each in caplog.records]
    assert len(told) == 2 and all("is built to move on its own" in each for each in told)
    assert "'link_0'" in told[1]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("v nan 0 0", "NaN"),
        ("f 1 2 99", "vertex 99"),
        ("v 1 2", "3 coordinates"),
        ("f 1 x 2", "line"),
    ],
)
def test_bad_mesh_is_refused(line, message, drawn):
    path = drawn / "textured_objs" / "original-5.obj"
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(InputError, match=message):
        read(drawn)


def test_one_far_vertex_is_refused_before_it_costs_anything(drawn):
    path = drawn / "textured_objs" / "original-5.obj"
    path.write_text(path.read_text() + "v 0 1e9 0\nf 1 2 9\n")
    with pytest.raises(InputError, match="coordinate is 1e"):
        read(drawn)


@pytest.mark.parametrize("named", [True, False])
def test_a_continuous_joint_is_a_door_where_it_hangs_by_an_edge(drawn, named):
    urdf = drawn / "mobility.urdf"
    text = urdf.read_text().replace(
        'name="joint_0" type="revolute"', 'name="joint_0" type="continuous"'
    )
    if not named:
        text = text.replace("cabinet_door_surface", "front").replace('"rotation_door', '"other')
        semantics = drawn / "semantics.txt"
        semantics.write_text(semantics.read_text().replace("rotation_door", "other"))
    urdf.write_text(text)
    door, *_, knob = read(drawn).moving
    assert (door.role, knob.role) == ("door", "knob")
    assert door.joint.travel == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(door.joint.axis, [0, 0, 1], atol=1e-9)  # as with limits: outwards


def test_a_tray_turns_and_has_neither_handle_nor_cavity(drawn, tmp_path):
    semantics = drawn / "semantics.txt"
    semantics.write_text(semantics.read_text().replace("hinge knob", "hinge tray"))
    built = build_articulated(read(drawn), tmp_path / "asset")
    tray = built.part("tray_2")
    assert (tray.joint.kind, tray.handle, tray.cavity) == ("hinge", None, None)


def test_missing_materials_are_one_warning(drawn, caplog):
    (drawn / "textured_objs" / "original.mtl").unlink()
    read(drawn)
    (told,) = [r.getMessage() for r in caplog.records if "original.mtl" in r.getMessage()]
    assert str(drawn) in told and "more like it" in told


def test_errors_name_the_folder_of_the_object(drawn, tmp_path, monkeypatch):
    monkeypatch.setattr("asset_pipeline.sources.partnet_mobility.links.MAX_SIZE", 0.1)
    (item,) = partnet_mobility.items(drawn.parent)
    with pytest.raises(InputError) as refused, partnet_mobility.opened(item):
        pass
    assert str(refused.value).startswith(f"{drawn}: the object would measure")
    (drawn / "meta.json").write_text(json.dumps({"model_cat": "Submarine"}))
    (result,) = build("partnet_mobility", drawn.parent, tmp_path / "out")
    assert result.reason.startswith(f"{drawn}: category 'Submarine'")
    assert not (tmp_path / "out").exists()


def test_unknown_category_says_which_are_known(drawn):
    (drawn / "meta.json").write_text('{"model_cat": "Piano"}')
    with pytest.raises(InputError, match=r"'Piano'.*StorageFurniture"):
        read(drawn)
    (drawn / "meta.json").unlink()  # then the heavy link's name tells
    assert read(drawn).category == "cabinet"


def test_archive_reads_like_its_folder_and_the_build_dispatches(drawn, tmp_path):
    archive = tmp_path / "4711.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in sorted(drawn.rglob("*.*")):
            file.write(path, path.relative_to(drawn.parent.parent))
    (item,) = partnet_mobility.items(archive)
    (folder,) = partnet_mobility.items(tmp_path / "dataset")
    assert item.name == folder.name == "4711"
    with partnet_mobility.opened(item) as zipped, partnet_mobility.opened(folder) as plain:
        for a, b in zip(zipped.base.parts, plain.base.parts, strict=True):
            np.testing.assert_array_equal(a.mesh.vertices, b.mesh.vertices)
    (first,) = build("partnet_mobility", archive, tmp_path / "out")
    (again,) = build("partnet_mobility", archive, tmp_path / "out")
    assert (first.status, again.status, first.reason) == ("built", "skipped", "")


@pytest.mark.sample(1)
@needs_data
@pytest.mark.parametrize("name", REAL)
def test_real_objects_open_and_hold_a_ball(name, tmp_path):
    item = next(i for i in partnet_mobility.items(ARCHIVE) if i.name == name)
    with partnet_mobility.opened(item) as scan:
        asset = build_articulated(scan, tmp_path / name)
        handles = {m.name for m in scan.moving if any(p.name == "handle" for p in m.parts)}
    assert check_asset(asset.folder).failures == ()
    assert {p.name for p in asset.parts if p.handle is not None} == handles
    hollow = [p for p in asset.parts if p.cavity is not None]
    assert len(hollow) == len(asset.parts)
    assert [takes_ball(asset, p) for p in hollow] == [""] * len(hollow)


@needs_data
def test_every_real_object_can_be_read():
    found = partnet_mobility.items(ARCHIVE)
    assert len(found) == 17
    item = next(i for i in found if i.name == "7263")
    with partnet_mobility.opened(item) as scan:
        assert [m.role for m in scan.moving].count("button") == 18
        assert scan.category == "microwave" and scan.appliance
        assert "non-commercial" in scan.provenance.licence and scan.provenance.inputs
