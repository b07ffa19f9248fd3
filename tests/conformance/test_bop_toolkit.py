"""Distances of poses equal those of bop_toolkit's functions, where BOP_TOOLKIT names its folder.

BOP_TOOLKIT=bop_toolkit python -m pytest tests/conformance/test_bop_toolkit.py
"""

from __future__ import annotations

import os
import sys

import numpy as np
import pytest

from manipose_mj.bop.pose_distances import add, add_s, mspd, mssd
from manipose_mj.bop.symmetries import model_symmetry
from tests.bop.test_pose_distances import INFOS, K, random_pose

POSES = 1000
# The step of BOP's challenges, as a share of the diameter.
STEP = 0.01


@pytest.fixture(scope="module")
def toolkit():
    folder = os.environ.get("BOP_TOOLKIT")
    if folder is None:
        pytest.skip("BOP_TOOLKIT names no folder of bop_toolkit")
    sys.path.insert(0, folder)
    try:
        from bop_toolkit_lib import (
            misc,  # first: pose_error imports it, and it imports pose_error
            pose_error,
        )
    finally:
        sys.path.remove(folder)
    return misc, pose_error


def test_mssd_mspd_and_add_are_those_of_bop_toolkit(toolkit):
    """A quarter of the poses for each kind of symmetry; every other estimate is near the truth."""
    misc, theirs = toolkit
    rng = np.random.default_rng(7)
    vertices = rng.normal(0, 0.04, (40, 3))
    compared = 0
    for info in INFOS.values():
        ours = model_symmetry(info).transforms
        symmetries = misc.get_symmetry_transformations(info, STEP)
        assert len(ours) == len(symmetries)
        for number in range(POSES // len(INFOS)):
            truth = random_pose(rng)
            estimate = random_pose(rng, truth if number % 2 else None)
            poses = []
            for pose in (estimate, truth):
                poses += [pose[:3, :3], 1000 * pose[:3, 3:]]
            millimetres = 1000 * vertices
            asked = (*poses, millimetres)
            expected = {
                mssd: theirs.mssd(*asked, symmetries) / 1000,
                mspd: theirs.mspd(*poses, K, millimetres, symmetries),
                add: theirs.add(*asked) / 1000,
                add_s: theirs.adi(*asked) / 1000,
            }
            found = {
                mssd: mssd(estimate, truth, ours, vertices),
                mspd: mspd(estimate, truth, ours, vertices, K),
                add: add(estimate, truth, vertices),
                add_s: add_s(estimate, truth, vertices),
            }
            for function, value in expected.items():
                assert abs(found[function] - value) < 1e-6, function.__name__
            compared += 1
    assert compared == POSES
