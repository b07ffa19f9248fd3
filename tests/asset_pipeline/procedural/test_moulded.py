"""Slabs from rounded polygons: exact sizes, volumes, and parts that fill what is seen."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh

from asset_pipeline.procedural.moulded import (
    facing,
    moulded,
    rectangle,
    rounded_polygon,
    slab_loops,
)
from asset_pipeline.procedural.snap_strap import snap_strap

GREY = (0.5, 0.5, 0.5, 1.0)
HOUSE = np.array([[0.04, 0.0], [0.04, 0.03], [0.0, 0.06], [-0.04, 0.03], [-0.04, 0.0]])


def test_rounding_takes_the_corners_off_and_nothing_else():
    radius = 0.01
    outline = rounded_polygon(rectangle(0.05, 0.03), radius, steps=60)
    x, y = outline.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert np.abs(outline).max(axis=0) == pytest.approx([0.05, 0.03], abs=1e-9)
    assert area == pytest.approx(0.1 * 0.06 - (4 - np.pi) * radius**2, rel=1e-5)


def test_inset_moves_every_side_inwards_by_the_same():
    outer = rounded_polygon(HOUSE, 0.004)
    inner = rounded_polygon(HOUSE, 0.004, inset=0.003)
    line = shapely.LinearRing(outer)
    found = [line.distance(shapely.Point(p)) for p in inner]
    assert np.allclose(found, 0.003, atol=2e-4)


@pytest.mark.parametrize("edges", [(0.0, 0.0), (0.002, 0.0), (0.003, 0.005)])
def test_a_slab_is_closed_as_high_as_asked_and_filled_by_its_parts(edges):
    loops = slab_loops(HOUSE, 0.006, -0.01, 0.02, edges=edges, cuts=(0.004,))
    piece = moulded(loops, ((14 / 30, GREY), (1.0, GREY)), density=1000.0)
    seen = trimesh.util.concatenate([s.surface() for s in piece.visual])
    seen.merge_vertices()
    assert seen.is_watertight
    assert seen.bounds[:, 2] == pytest.approx([-0.01, 0.02])
    filled = sum(s.surface().volume for s in piece.collision)
    assert filled == pytest.approx(seen.volume, rel=0.025)
    assert piece.mass.mass == pytest.approx(1000.0 * seen.volume)


def test_bands_of_colour_end_at_the_cut():
    loops = slab_loops(rectangle(0.02, 0.02), 0.002, 0.0, 0.01, edges=(0.001, 0.001), cuts=(0.004,))
    low, high = moulded(loops, ((0.4, GREY), (1.0, GREY)), density=1.0).visual
    assert low.surface().bounds[1, 2] == pytest.approx(0.004)
    assert high.surface().bounds[0, 2] == pytest.approx(0.004)


@pytest.mark.parametrize("normal", [(1, 0, 0), (0, -1, 0), (0.6, 0, 0.8)])
def test_a_face_looks_along_its_normal_and_stands_upright(normal):
    pose = facing(normal, (1.0, 2.0, 3.0))
    assert pose[:3, 2] == pytest.approx(normal)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    assert pose[2, 1] > 0 and pose[2, 0] == pytest.approx(0.0)


def test_a_strap_goes_round_the_edge_and_not_through_the_object():
    strap = snap_strap(
        start=0.03, edge=0.05, past=0.02, height=0.02, width=0.02, rgba=GREY, metal=GREY
    )
    low, high = trimesh.util.concatenate([s.surface() for s in strap.visual]).bounds
    assert low[2] == pytest.approx(0.0, abs=2e-4)
    assert high[0] == pytest.approx(0.07, abs=5e-4)
    inside = trimesh.creation.box(bounds=[[-0.05, -0.05, 0.0005], [0.0485, 0.05, 0.0195]])
    for part in strap.collision:
        assert not inside.contains(part.surface().vertices).any()
