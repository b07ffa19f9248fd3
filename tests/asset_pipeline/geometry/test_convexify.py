"""Convex parts stay close to the surface, keep hollows open, and are computed once."""

import numpy as np
import pytest
import trimesh

from asset_pipeline.geometry import convexify as convexify_module
from asset_pipeline.geometry.convexify import convexify, fidelity
from asset_pipeline.geometry.hull_reduction import reduced_hull
from asset_pipeline.geometry.repair import closed
from manipose_mj.errors import InputError

RADIUS, HEIGHT, WALL = 0.035, 0.08, 0.004


def _cup() -> trimesh.Trimesh:
    """A cup of revolution with a 4 mm wall, its outside standing on z = 0."""
    inner = RADIUS - WALL
    outline = [(0, 0), (RADIUS, 0), (RADIUS, HEIGHT), (inner, HEIGHT), (inner, WALL), (0, WALL)]
    return trimesh.creation.revolve(np.array(outline), sections=48)


def _clear(parts, center, radius) -> bool:
    """Whether a ball touches none of the convex parts."""
    for part in parts:
        _, distance, _ = trimesh.proximity.closest_point(part.mesh, [center])
        if part.mesh.contains([center])[0] or distance[0] < radius:
            return False
    return True


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def cup_parts(cache):
    return convexify(_cup(), cache=cache)


def test_cup_stays_hollow(cup_parts):
    room = RADIUS - WALL - 0.005
    for height in np.linspace(WALL + 0.004 + room, HEIGHT - 0.01, 4):
        assert _clear(cup_parts, [0, 0, height], room)
    assert not _clear(cup_parts, [RADIUS - WALL / 2, 0, HEIGHT / 2], 1e-4)  # but its wall is there


def test_parts_are_small_and_convex(cup_parts):
    assert 4 < len(cup_parts) <= 32
    for part in cup_parts:
        assert len(part.mesh.vertices) <= 32
        assert part.mesh.volume == pytest.approx(part.mesh.convex_hull.volume, rel=1e-6)


def test_parts_follow_the_surface(cup_parts):
    found = fidelity(_cup(), cup_parts)
    assert found.gap < 0.0015 and found.bulge < 0.005 and found.bulge_95 < 0.003


def test_fidelity_sees_what_is_missing_and_what_is_too_much(cup_parts):
    cup = _cup()
    hull = convexify_module.Shape(kind="mesh", mesh=cup.convex_hull)
    assert fidelity(cup, (hull,)).bulge > 0.01 and fidelity(cup, (hull,)).gap < 1e-4
    assert fidelity(cup, cup_parts[: len(cup_parts) // 2]).gap > 0.01


def test_second_call_reads_the_cache(cache, cup_parts, monkeypatch):
    monkeypatch.setattr(convexify_module, "_decompose", lambda *_: pytest.fail("not cached"))
    again = convexify(_cup(), cache=cache)
    assert len(again) == len(cup_parts)
    np.testing.assert_array_equal(again[0].mesh.vertices, cup_parts[0].mesh.vertices)


def test_other_settings_and_damaged_entries_are_misses(tmp_path, monkeypatch):
    box = trimesh.creation.box(extents=[0.05, 0.06, 0.07])
    calls = []
    decompose = convexify_module._decompose
    monkeypatch.setattr(convexify_module, "_decompose", lambda *a: calls.append(1) or decompose(*a))
    convexify(box, cache=tmp_path)
    convexify(box, convexify_module.ConvexSettings(max_parts=5), cache=tmp_path)
    assert len(calls) == 2
    for entry in tmp_path.rglob("*.npz"):
        entry.write_bytes(b"torn")
    assert len(convexify(box, cache=tmp_path)) == 1
    assert len(calls) == 3


def test_cache_that_cannot_be_written_is_not_needed(tmp_path):
    (tmp_path / "file").write_text("")
    box = trimesh.creation.box(extents=[0.05, 0.06, 0.07])
    assert len(convexify(box, cache=tmp_path / "file")) == 1


def test_convex_object_is_one_hull_of_its_volume():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.04)
    hull = reduced_hull(np.asarray(ball.vertices), 64)
    assert len(hull.vertices) == 64
    assert hull.volume == pytest.approx(ball.volume, rel=1e-6)
    radii = np.linalg.norm(hull.vertices, axis=1)
    assert radii.max() < 0.0425 and np.abs(hull.triangles_center).max() > 0.035


def _toolbox() -> trimesh.Trimesh:
    """A box of 300 x 100 x 200 mm with a carrying handle of 12 mm on top, which is open below."""
    outer = trimesh.creation.box((0.1, 0.012, 0.04)).apply_translation((0, 0, 0.12))
    inner = trimesh.creation.box((0.076, 0.1, 0.028)).apply_translation((0, 0, 0.114))
    handle = trimesh.boolean.difference([outer, inner], engine="manifold")
    return trimesh.boolean.union([trimesh.creation.box((0.3, 0.1, 0.2)), handle], engine="manifold")


def _bored(extents, hole, shift=0.0) -> trimesh.Trimesh:
    """A box with a square hole along z; `shift` [m] along z makes it a well."""
    bore = trimesh.creation.box(hole).apply_translation((0, 0, shift))
    return trimesh.boolean.difference([trimesh.creation.box(extents), bore], engine="manifold")


@pytest.mark.parametrize(
    ("mesh", "free"),
    [
        (_toolbox(), (0, 0, 0.114)),  # in the handle
        (_bored((0.2, 0.2, 0.02), (0.05, 0.05, 0.1)), (0, 0, 0)),
        (_bored((0.08, 0.08, 0.1), (0.02, 0.02, 0.1), 0.03), (0, 0, 0.02)),
    ],
    ids=["toolbox", "plate", "pen holder"],
)
def test_handles_holes_and_wells_of_little_volume_stay_open(tmp_path, mesh, free):
    assert mesh.volume > 0.92 * mesh.convex_hull.volume
    assert _clear(convexify(mesh, cache=tmp_path), free, 0.005)


def test_shallow_hollows_are_filled_by_the_hull(tmp_path):
    dented = _bored((0.08, 0.08, 0.1), (0.03, 0.03, 0.016), 0.05)  # 8 mm deep
    assert len(convexify(dented, cache=tmp_path)) == 1


def test_few_points_are_kept_exactly():
    box = trimesh.creation.box(extents=[0.05, 0.06, 0.07])
    assert reduced_hull(np.asarray(box.vertices), 32).volume == pytest.approx(box.volume)


def test_flat_mesh_is_refused(tmp_path):
    flat = trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0, 1, 2]])
    with pytest.raises(InputError, match="no volume"):
        convexify(flat, cache=tmp_path)


def test_texture_seams_do_not_open_a_mesh():
    box = trimesh.creation.box(extents=[0.05, 0.06, 0.07])
    split = trimesh.Trimesh(
        np.asarray(box.triangles).reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False
    )
    assert not split.is_watertight
    assert closed(split).volume == pytest.approx(box.volume)
    assert closed(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])) is None
