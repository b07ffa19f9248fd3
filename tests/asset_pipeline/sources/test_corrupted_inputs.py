"""Whatever is wrong with a file: it is refused by name in one line, or read as something sound."""

from __future__ import annotations

import logging
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from asset_pipeline.build import data_set as build_module
from asset_pipeline.sources.articulated_scan import ArticulatedScan
from asset_pipeline.sources.scan import Scan
from manipose_mj.errors import InputError
from tests.asset_pipeline.sources.damaged_files import Case, cases
from tests.asset_pipeline.sources.valid_files import SOURCES, valid

QUICK = settings(
    max_examples=100,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


def _read(source: str, root: Path) -> list[Scan | ArticulatedScan]:
    module = build_module.SOURCES[source]
    scans = []
    for item in module.items(root):
        module.inputs(item)
        with module.opened(item) as scan:
            scans.append(scan)
    return scans


def _tree(folder: Path) -> dict[str, tuple[int, int]]:
    return {
        str(p.relative_to(folder)): (p.stat().st_size, p.stat().st_mtime_ns)
        for p in folder.rglob("*")
    }


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("archive", ["", ".tgz"])
def test_undamaged_objects_are_read_without_a_warning(tmp_path, source, archive, caplog):
    root = Case(source, "none", valid(source), archive).write(tmp_path)
    with caplog.at_level(logging.WARNING):
        (scan,) = _read(source, root)
    assert not caplog.records
    assert scan.provenance.inputs


@QUICK
@given(case=cases(subdivisions=2))
def test_damage_is_refused_by_name_or_leaves_something_sound(case):
    with tempfile.TemporaryDirectory() as folder:
        root = case.write(Path(folder) / "in")
        before = _tree(Path(folder))
        try:
            scans = _read(case.source, root)
        except InputError as error:
            assert str(root) in str(error), error
            assert "\n" not in str(error), error
        else:
            for scan in scans:
                _assert_sound(scan)
        assert _tree(Path(folder)) == before


def _assert_sound(scan: Scan | ArticulatedScan) -> None:
    if isinstance(scan, Scan):
        meshes = [scan.mesh]
        assert 0.003 <= scan.mesh.extents.max() <= 3.0
    else:
        meshes = [part.mesh for link in (scan.base, *scan.moving) for part in link.parts]
        assert all(np.isfinite(link.joint.travel) for link in scan.moving)
    for mesh in meshes:
        assert len(mesh.faces) and np.isfinite(mesh.vertices).all()
        assert mesh.faces.min() >= 0 and mesh.faces.max() < len(mesh.vertices)
