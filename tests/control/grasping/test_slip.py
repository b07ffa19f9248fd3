"""What is round about its axis has not slipped when it is seen turned about that axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.execution.slip import exceeds, slip_of
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

LIMIT = (0.04, 0.6)


@pytest.fixture(scope="module")
def estimate(environment):
    return OraclePerception(environment.task, environment.physics).observe()


def test_a_turn_about_the_axis_of_a_can_is_none(estimate):
    then = compose(rotation_about(np.array([0.0, 1.0, 0.0]), 0.3), np.array([0.0, 0.01, 0.05]))
    turned = then @ compose(rotation_about(np.array([1.0, 0.0, 0.0]), 2.0), np.zeros(3))
    can = replace(estimate.objects["object"], uncertainty=0.002)
    assert can.label.symmetry.axial
    seen = replace(estimate, objects={"object": can})
    assert not exceeds(slip_of(seen, "object", turned, then), LIMIT)
    unlike = replace(can, label=replace(can.label, symmetry=SymmetryGroup(np.eye(3)[None])))
    for other in (replace(estimate, objects={"object": unlike}), estimate):
        assert slip_of(other, "object", turned, then)[1] == pytest.approx(2.0, abs=1e-6)


def test_a_tilt_and_a_shift_are_slip_of_objects_and_handles(estimate):
    then = np.eye(4)
    tilted = compose(rotation_about(np.array([0.0, 0.0, 1.0]), 0.8), np.array([0.05, 0.0, 0.0]))
    for name in ("object", "middle_drawer"):
        shift, turn = slip_of(estimate, name, tilted, then)
        assert shift == pytest.approx(0.05)
        assert turn == pytest.approx(0.8, abs=1e-6)
        assert exceeds((shift, turn), LIMIT)
