"""`manipose view` with a window that only counts: no display is needed to test it."""

from __future__ import annotations

from contextlib import nullcontext
from itertools import pairwise

import pytest

from manipose_mj.cli.main import main


class Window(nullcontext):
    """Shuts after some pictures."""

    most = 5

    def __init__(self, data) -> None:
        super().__init__(self)
        self.data, self.times = data, []

    def is_running(self) -> bool:
        return len(self.times) < self.most

    def lock(self):
        return nullcontext()

    def sync(self) -> None:
        self.times.append(self.data.time)


@pytest.fixture
def windows(monkeypatch):
    """Those that are opened."""
    found = []

    def opened(model, data):
        found.append(Window(data))
        return found[-1]

    monkeypatch.setattr("manipose_mj.mjcf.views.viewer.require_display", lambda: None)
    monkeypatch.setattr("manipose_mj.mjcf.views.viewer.open_viewer", opened)
    return found


def test_the_window_shows_a_running_task(windows):
    assert main(["view", "single_object/target_pose", "--objects", "mug_000", "--seed", "3"]) == 0
    assert windows[0].times == pytest.approx([0.02, 0.04, 0.06, 0.08, 0.1])


@pytest.mark.full
def test_an_episode_with_other_objects_has_a_window_of_its_own(windows, monkeypatch):
    monkeypatch.setattr(
        "manipose_mj.tasks.core.task.ManipulationTask.should_terminate_episode", _ends
    )
    monkeypatch.setattr(Window, "most", 12)
    objects = ["--objects", "mug_000", "box_000", "can_000"]
    assert main(["view", "single_object/target_pose", *objects]) == 0
    assert len(windows) > 1
    for before, window in pairwise(windows):
        assert window.times and window.data is not before.data


def _ends(task, physics) -> bool:
    """After five steps."""
    return physics.data.time > 0.09
