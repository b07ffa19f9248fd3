"""A handle that nobody named is found: a bar drawn as one part with its door, a part named knob; a frame is none."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from asset_pipeline.sources.articulated_scan import LinkJoint, PartMesh, ScanLink, Surface
from asset_pipeline.sources.drawn_handle import with_handle

BASE = np.array([(-0.3, -0.3, 0.0), (0.3, 0.3, 0.8)])
HINGE = LinkJoint("hinge", np.array([-0.3, -0.3, 0.2]), np.array([0.0, 0.0, -1.0]), 1.5)
SLIDE = LinkJoint("slide", np.zeros(3), np.array([-1.0, 0.0, 0.0]), 0.3)
PANEL = ((-0.33, -0.3, 0.2), (-0.30, 0.3, 0.7))
BAR = ((-0.39, -0.25, 0.64), (-0.37, 0.25, 0.66))
POSTS = [((-0.37, y, 0.645), (-0.33, y + 0.01, 0.655)) for y in (-0.2, 0.2)]
FRAME = ((-0.336, -0.2, 0.3), (-0.33, 0.2, 0.5))
THIN_BAR = ((-0.373, -0.25, 0.64), (-0.365, 0.25, 0.66))  # 8 mm, as far off the door as fingers go
MOULDING = ((-0.348, -0.25, 0.64), (-0.330, 0.25, 0.66))  # before the door, without room behind
SLAT = ((-0.345, -0.25, 0.64), (-0.341, 0.25, 0.66))  # too near to the door to be held
KNOB = ((-0.36, -0.02, 0.6), (-0.345, 0.02, 0.64))
BALL = ((-0.375, -0.015, 0.45), (-0.345, 0.015, 0.48))  # 30 mm on a post of 12 mm
POST = ((-0.36, -0.006, 0.459), (-0.33, 0.006, 0.471))
STUD = ((-0.344, -0.015, 0.45), (-0.330, 0.015, 0.48))  # too flat to be taken
BOARD = ((-0.36, -0.05, 0.4), (-0.330, 0.05, 0.5))  # too wide on either side
LEDGE = ((-0.37, -0.3, 0.2), (-0.330, 0.3, 0.22))  # stands out as a bar does, without room behind


def _door(*boxes, texture=None) -> ScanLink:
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=b) for b in boxes])
    if texture is not None:
        mesh.visual = trimesh.visual.TextureVisuals(uv=np.asarray(mesh.vertices)[:, 1:])
    surface = Surface(mesh, (1.0, 1.0, 1.0, 1.0), texture)
    return ScanLink("door_0", (PartMesh("door", "door-1", (surface,)),), HINGE, "door")


def _drawer(link: ScanLink) -> ScanLink:
    return replace(link, name="drawer_0", joint=SLIDE, role="drawer")


def _knob(*boxes, name="knob", key="knob-22") -> PartMesh:
    return PartMesh(name, key, _door(*boxes).parts[0].surfaces)


def _with(link: ScanLink, *parts: PartMesh) -> ScanLink:
    return replace(link, parts=(*link.parts, *parts))


@pytest.mark.parametrize("textured", [False, True])
def test_a_bar_becomes_the_handle(tmp_path, textured):
    texture = tmp_path / "steel.png" if textured else None
    door, handle = with_handle(_door(PANEL, FRAME, *POSTS, BAR, texture=texture), BASE).parts
    assert (door.name, handle.name) == ("door", "handle")
    np.testing.assert_allclose(handle.mesh.bounds, BAR, atol=1e-9)
    np.testing.assert_allclose(door.mesh.bounds[0, 0], -0.37, atol=1e-9)  # its posts stay
    assert len(door.mesh.faces) + len(handle.mesh.faces) == 5 * 12
    if textured:
        own = handle.surfaces[0].mesh
        np.testing.assert_allclose(own.visual.uv, np.asarray(own.vertices)[:, 1:], atol=1e-9)


def test_a_thin_bar_is_a_handle_where_there_is_room_behind_it():
    door, handle = with_handle(_door(PANEL, FRAME, *POSTS, THIN_BAR), BASE).parts
    np.testing.assert_allclose(handle.mesh.bounds, THIN_BAR, atol=1e-9)
    assert len(door.mesh.faces) + len(handle.mesh.faces) == 5 * 12


@pytest.mark.parametrize("more", [(), (FRAME,), (KNOB,), (MOULDING,), (SLAT,)])
def test_what_is_no_handle_leaves_the_door_as_it_was(more):
    door = _door(PANEL, *more)
    assert with_handle(door, BASE) is door


def test_a_named_handle_is_kept():
    named = _knob(KNOB, name="handle", key="handle-2")
    door = _with(_door(PANEL, BAR), named, _knob(BALL))
    assert with_handle(door, BASE) is door


@pytest.mark.parametrize("opened", [_door(PANEL, FRAME), _drawer(_door(PANEL, LEDGE))])
@pytest.mark.parametrize("name", ["knob", "Drawer_Knob"])
def test_a_part_named_knob_is_the_handle(opened, name):
    panel, handle = with_handle(_with(opened, _knob(BALL, POST, name=name)), BASE).parts
    assert panel is opened.parts[0]
    assert (handle.name, handle.key) == ("handle", "knob-22")
    np.testing.assert_allclose(handle.mesh.bounds[:, 0], (-0.375, -0.33), atol=1e-9)


def test_knobs_drawn_in_pieces_or_in_pairs_are_all_handles():
    door = _with(_door(PANEL), _knob(BALL), _knob(POST, key="knob-23"))
    assert [part.name for part in with_handle(door, BASE).parts] == ["door", "handle", "handle"]


@pytest.mark.parametrize(
    "knob", [_knob(STUD), _knob(BOARD), _knob(BALL, POST, name="control_knob"), _knob(PANEL)]
)
def test_a_knob_that_no_hand_can_take_is_no_handle(knob):
    drawer = _drawer(_with(_door(PANEL), knob))
    assert with_handle(drawer, BASE) is drawer


def test_a_bar_with_room_behind_it_goes_before_knobs():
    door = _with(_door(PANEL, *POSTS, BAR), _knob(BALL, POST))
    assert [part.name for part in with_handle(door, BASE).parts] == ["door", "knob", "handle"]


@pytest.mark.parametrize("role", ["lid", "tray", "knob"])
def test_only_doors_and_drawers_have_knobs_for_handles(role):
    link = replace(_with(_door(PANEL), _knob(BALL, POST)), role=role)
    assert with_handle(link, BASE) is link


def test_of_a_drawer_a_single_knob_without_a_name_is_the_handle():
    front, handle = with_handle(_drawer(_door(PANEL, BALL, POST)), BASE).parts
    np.testing.assert_allclose(handle.mesh.bounds, BALL, atol=1e-9)
    assert len(front.mesh.faces) + len(handle.mesh.faces) == 3 * 12
    door, stud = _door(PANEL, BALL, POST), _drawer(_door(PANEL, STUD))
    assert with_handle(door, BASE) is door
    assert with_handle(stud, BASE) is stud
