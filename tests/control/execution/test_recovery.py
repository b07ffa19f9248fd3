"""What is held is put down before another plan: on the table, or else where it was taken."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from manipose_mj.control.execution.primitives import Primitives, _Held
from manipose_mj.control.execution.recovery import let_go_safely
from manipose_mj.failures import StageFailure
from manipose_mj.mjcf.panda.kinematics import HOME

FAILURE = StageFailure("plan", "no way to set mug down where it should go")
LIFT = np.stack([HOME + 0.01 * k for k in range(4)])


class Executor:
    """Follows what it is told to."""

    feels_joints = False

    def __init__(self) -> None:
        self.followed = []

    def follow(self, targets):
        self.followed.append(targets)
        yield from ()


@pytest.fixture
def primitives(monkeypatch):
    held = Primitives(Executor())  # type: ignore[arg-type]
    held._held = _Held("mug", SimpleNamespace(), np.eye(4))  # type: ignore[arg-type]

    def no_way(*_):
        raise StageFailure("plan", "no way to lift mug")
        yield

    def release(planner, name):
        held._held = None
        yield from ()

    monkeypatch.setattr(held, "move_to", no_way)
    monkeypatch.setattr(held, "release", release)
    return held


def _let_go(primitives) -> None:
    label = SimpleNamespace(
        rotation=np.eye(3), extents=np.full(3, 0.1), reach=lambda r: np.full(3, 0.05)
    )
    mug = SimpleNamespace(label_pose=np.eye(4), label=label, rests=())
    estimate = SimpleNamespace(objects={"mug": mug}, parts={})
    for _ in let_go_safely(primitives, SimpleNamespace(), estimate, FAILURE):  # type: ignore[arg-type]
        pass


def test_what_was_only_lifted_goes_back_the_way_it_came_and_is_taken_otherwise_next(primitives):
    primitives._lifted = LIFT
    _let_go(primitives)
    assert primitives.held is None
    np.testing.assert_array_equal(primitives._executor.followed[0], LIFT[::-1])
    np.testing.assert_array_equal(primitives._slipped["mug"], [np.eye(4)])


def test_what_was_carried_on_is_not_let_fall(primitives):
    with pytest.raises(StageFailure):
        _let_go(primitives)
    assert primitives.held == "mug" and not primitives._executor.followed
