"""A hand that lets go comes away, or opens all the way: handles may be wider in front of the fingers."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.control.execution import letting_go
from manipose_mj.failures import StageFailure
from manipose_mj.mjcf.panda.kinematics import HOME

AWAY = HOME + [0.0, -0.3, 0.0, 0.0, 0.0, 0.0, 0.0]


class Hand:
    """Stays where it is until it is as wide open as it `needs` to be [m]."""

    feels_joints = True

    def __init__(self, needs: float) -> None:
        self.needs, self.opened, self._joints = needs, [], HOME

    def observe(self):
        return SimpleNamespace(scene=None, parts={"door": None})

    def joints(self):
        return self._joints

    def hold(self, name):
        assert name is None

    def open_to(self, opening):
        self.opened.append(opening)
        yield from ()

    def follow(self, targets):
        if self.opened[-1] >= self.needs:
            self._joints = targets[-1]
        yield from ()

    def wait(self, duration):
        yield from ()

    def relax(self):
        yield from ()


@pytest.mark.parametrize(("needs", "opened"), [(0.01, [0.02]), (0.05, [0.02, MAX_OPENING])])
def test_a_hand_that_hangs_on_a_handle_opens_all_the_way(monkeypatch, needs, opened):
    monkeypatch.setattr(letting_go, "opening_to_let_go", lambda *_: 0.02)
    monkeypatch.setattr(letting_go, "retreat_from", lambda *_, **__: np.stack([HOME, AWAY]))
    hand = Hand(needs)
    planner = SimpleNamespace()
    planner.within = lambda scene: planner
    for _ in letting_go.let_go(hand, planner, "door"):
        pass
    assert hand.opened == opened
    np.testing.assert_array_equal(hand.joints(), AWAY)


def test_a_hand_without_room_for_more_backs_off_a_short_way(monkeypatch):
    def short_only(*arguments, close):
        if not close:
            raise StageFailure("release", "no way to back off from door")
        return np.stack([HOME, AWAY])

    monkeypatch.setattr(letting_go, "opening_to_let_go", lambda *_: 0.02)
    monkeypatch.setattr(letting_go, "retreat_from", short_only)
    hand = Hand(0.01)
    planner = SimpleNamespace()
    planner.within = lambda scene: planner
    for _ in letting_go.let_go(hand, planner, "door"):
        pass
    np.testing.assert_array_equal(hand.joints(), AWAY)
