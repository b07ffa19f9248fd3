"""What is seen of an asset is where it touches, or `check` says which body is not."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from asset_pipeline.build.emit import model_element
from asset_pipeline.build.link_visuals import MAX_CELL, Textures, link_visuals
from asset_pipeline.checks.visual_check import visual_failures
from asset_pipeline.geometry.mass import shape_mass_properties
from asset_pipeline.geometry.vertex_clustering import coarser
from asset_pipeline.sources.articulated_scan import PartMesh, Surface
from manipose_mj.assets.asset import MODEL_FILE
from manipose_mj.assets.geometry import Body, Shape
from manipose_mj.poses import compose

HALF = np.array([0.3, 0.2, 0.4])
THICK = 0.01


def _walls(*left_out: int) -> tuple[Shape, ...]:
    """A box of six boards, without those left out."""
    boards = []
    for side in set(range(6)) - set(left_out):
        axis, sign = divmod(side, 2)
        size = HALF.copy()
        size[axis] = THICK / 2
        centre = np.zeros(3)
        centre[axis] = (2 * sign - 1) * (HALF[axis] - THICK / 2)
        boards.append(Shape("box", tuple(size), compose(np.eye(3), centre)))
    return tuple(boards)


def _failures(folder, visual: tuple[Shape, ...]) -> list[str]:
    solid = _walls()
    body = Body("base", solid, visual, shape_mass_properties(solid, 400.0))
    folder.mkdir(exist_ok=True)
    tree = ElementTree.ElementTree(model_element("thing", (body,), folder))
    tree.write(folder / MODEL_FILE, encoding="unicode")
    return visual_failures(folder)


def test_sound_visuals_pass(tmp_path):
    assert _failures(tmp_path, _walls()) == []
    # One sheet without thickness in the middle of every board.
    sheets = trimesh.creation.box(extents=2 * HALF - THICK / 2)
    assert _failures(tmp_path, (Shape("mesh", mesh=sheets),)) == []


@pytest.mark.parametrize("side", range(6))
def test_a_lost_wall_is_told_though_the_others_keep_the_bounds(tmp_path, side):
    (failure,) = _failures(tmp_path, _walls(side))
    assert "% of the collision surface of 'base' has no visual near it" in failure


def test_a_visual_that_ends_early_is_told(tmp_path):
    low = tuple(
        replace(s, pose=s.pose @ compose(np.eye(3), np.array([0, 0, -0.02]))) for s in _walls()
    )
    (failure,) = _failures(tmp_path, low)
    assert "visual of 'base' ends 20 mm from where its collision shapes do" in failure


def test_a_spike_is_told(tmp_path):
    spike = Shape("box", (0.001, 0.001, 0.05), compose(np.eye(3), np.array([0, 0, 0.4])))
    (failure,) = _failures(tmp_path, (*_walls(), spike))
    assert "ends 50 mm from where its collision shapes do; at most 8 mm" in failure


def _drawn_from_both_sides(density: int) -> trimesh.Trimesh:
    """An open cupboard of sheets without thickness, each face with its reverse, as PartNet-Mobility draws."""
    box = trimesh.creation.box(extents=2 * HALF)
    box.update_faces(np.asarray(box.face_normals)[:, 0] > -0.5)
    for _ in range(density):
        box = box.subdivide()
    faces = np.concatenate([box.faces, box.faces[:, ::-1]])
    return trimesh.Trimesh(box.vertices, faces, process=False)


def test_many_faces_become_few_and_no_wall_is_lost(tmp_path):
    drawn = _drawn_from_both_sides(5)
    few = coarser(drawn, 2000, 0.1)
    assert len(drawn.faces) == 20480 and 100 < len(few.faces) <= 2000
    np.testing.assert_allclose(few.bounds, drawn.bounds, atol=1e-9)
    assert abs(few.area / drawn.area - 1) < 0.02
    normals = np.asarray(few.face_normals)
    np.testing.assert_allclose(normals.sum(axis=0), 0, atol=1e-9)  # reverses are kept
    assert coarser(drawn, 20480, 0.1) is drawn


def test_no_budget_of_faces_moves_a_point_by_more_than_a_cell(tmp_path):
    rng = np.random.default_rng(0)
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    ball.vertices += rng.normal(scale=1e-4, size=ball.vertices.shape)
    part = PartMesh("ball", "ball-0", (Surface(ball, (0.5, 0.5, 0.5, 1.0)),))
    (shape,) = link_visuals([part], Textures(tmp_path))
    gaps = np.abs(np.linalg.norm(np.asarray(shape.mesh.triangles_center), axis=1) - 0.1)
    assert len(shape.mesh.faces) < len(ball.faces) and gaps.max() < MAX_CELL
