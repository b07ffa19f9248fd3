"""A handle that is drawn as one part with its door is found, and a frame or a knob is none."""

import numpy as np
import pytest
import trimesh

from asset_pipeline.build.drawn_handle import with_handle
from asset_pipeline.sources.articulated_scan import PartMesh, ScanLink, Surface

OUT = np.array([-1.0, 0.0, 0.0])
PANEL = ((-0.33, -0.3, 0.2), (-0.30, 0.3, 0.7))
BAR = ((-0.39, -0.25, 0.64), (-0.37, 0.25, 0.66))
POSTS = [((-0.37, y, 0.645), (-0.33, y + 0.01, 0.655)) for y in (-0.2, 0.2)]
FRAME = ((-0.336, -0.2, 0.3), (-0.33, 0.2, 0.5))
THIN_BAR = ((-0.373, -0.25, 0.64), (-0.365, 0.25, 0.66))  # 8 mm, as far off the door as fingers go
MOULDING = ((-0.348, -0.25, 0.64), (-0.330, 0.25, 0.66))  # before the door, without room behind
SLAT = ((-0.345, -0.25, 0.64), (-0.341, 0.25, 0.66))  # too near to the door to be held
KNOB = ((-0.36, -0.02, 0.6), (-0.345, 0.02, 0.64))


def _door(*boxes, texture=None) -> ScanLink:
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=b) for b in boxes])
    if texture is not None:
        mesh.visual = trimesh.visual.TextureVisuals(uv=np.asarray(mesh.vertices)[:, 1:])
    surface = Surface(mesh, (1.0, 1.0, 1.0, 1.0), texture)
    return ScanLink("door_0", (PartMesh("door", "door-1", (surface,)),), None, "door")


@pytest.mark.parametrize("textured", [False, True])
def test_a_bar_becomes_the_handle(tmp_path, textured):
    texture = tmp_path / "steel.png" if textured else None
    door, handle = with_handle(_door(PANEL, FRAME, *POSTS, BAR, texture=texture), OUT).parts
    assert (door.name, handle.name) == ("door", "handle")
    np.testing.assert_allclose(handle.mesh.bounds, BAR, atol=1e-9)
    np.testing.assert_allclose(door.mesh.bounds[0, 0], -0.37, atol=1e-9)  # its posts stay
    assert len(door.mesh.faces) + len(handle.mesh.faces) == 5 * 12
    if textured:
        own = handle.surfaces[0].mesh
        np.testing.assert_allclose(own.visual.uv, np.asarray(own.vertices)[:, 1:], atol=1e-9)


def test_a_thin_bar_is_a_handle_where_there_is_room_behind_it():
    door, handle = with_handle(_door(PANEL, FRAME, *POSTS, THIN_BAR), OUT).parts
    np.testing.assert_allclose(handle.mesh.bounds, THIN_BAR, atol=1e-9)
    assert len(door.mesh.faces) + len(handle.mesh.faces) == 5 * 12


@pytest.mark.parametrize("more", [(), (FRAME,), (KNOB,), (MOULDING,), (SLAT,)])
def test_what_is_no_handle_leaves_the_door_as_it_was(more):
    door = _door(PANEL, *more)
    assert with_handle(door, OUT) is door


def test_a_named_handle_is_kept():
    named = PartMesh("handle", "handle-2", _door(KNOB).parts[0].surfaces)
    door = ScanLink("door_0", (*_door(PANEL, BAR).parts, named), None, "door")
    assert with_handle(door, OUT) is door
