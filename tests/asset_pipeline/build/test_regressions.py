"""Objects that once built badly: a box that trembled at rest, furniture whose visuals lost walls."""

from __future__ import annotations

import tarfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from asset_pipeline.build import steady_body
from asset_pipeline.build.data_set import build
from asset_pipeline.build.steady_body import steadied
from asset_pipeline.checks.asset_check import check
from asset_pipeline.geometry.hull_reduction import reduced_hull
from asset_pipeline.geometry.mass import shape_mass_properties
from asset_pipeline.sources.scan import load_scan_mesh
from manipose_mj.assets.asset import StablePose
from manipose_mj.assets.geometry import Body, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup
from tests.places import REAL_DATA

BOX = trimesh.creation.box(extents=(0.1, 0.06, 0.04))
ARCHIVE = REAL_DATA / "regressions.tar.xz"
needs_regressions = pytest.mark.skipif(not ARCHIVE.is_file(), reason=f"{ARCHIVE} is not there")


@pytest.fixture(scope="module")
def regressions(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("regressions")
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(folder, filter="data")
    return folder


def _steadied(mesh: trimesh.Trimesh) -> tuple[Body, tuple[StablePose, ...]]:
    """What the mesh's hull ends as, and how it rests."""
    hull = Shape("mesh", mesh=reduced_hull(np.asarray(mesh.vertices), 32))
    body = Body("box", (hull,), (), shape_mass_properties((hull,), 400.0))
    extents = np.ptp(np.asarray(mesh.vertices), axis=0)
    label = PoseLabel(np.zeros(3), np.eye(3), "mirror", extents, SymmetryGroup.identity())
    steady, poses = steadied(body, label)
    assert poses
    return steady, poses


def test_a_box_that_lies_still_stays_one_part():
    assert len(_steadied(BOX)[0].collision) == 1


def test_a_box_that_trembles_becomes_two_halves(monkeypatch):
    monkeypatch.setattr(steady_body, "_still", lambda body, poses: len(body.collision) == 2)
    cut, _ = _steadied(BOX)
    assert len(cut.collision) == 2
    volumes = [shape.surface().volume for shape in cut.collision]
    assert sum(volumes) == pytest.approx(BOX.volume, rel=1e-6)


@needs_regressions
def test_a_box_with_an_uneven_bottom_lies_still(regressions):
    scan = regressions / "ycb" / "009_gelatin_box" / "google_16k" / "textured.obj"
    assert steady_body._still(*_steadied(load_scan_mesh(scan)))


@pytest.mark.full
@needs_regressions
@pytest.mark.parametrize("source", ["ycb", "partnet_mobility"])
def test_regressions_build_and_pass_the_check(regressions, tmp_path, source):
    results = build(source, regressions / source, tmp_path / source)
    assert [r.reason for r in results if r.status != "built"] == []
    assert all(len(r.warnings) < 8 for r in results)
    assert [line for r in check(tmp_path / source) for line in r.failures] == []
