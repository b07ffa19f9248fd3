"""Starts that cannot be written into a scene are told before anything moves."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.tasks.core.start import EpisodeStart, PlacedFurniture, PlacedObject, check_start
from manipose_mj.tasks.goals import OpenGoal, PoseGoal

GOALS = (PoseGoal("object", np.eye(4)),)
PLACED = {"object": PlacedObject(0, np.eye(4))}
FURNITURE = (PlacedFurniture(0, np.zeros(3), np.eye(4)[0]),)


def test_what_fits_its_scene_is_a_start():
    check_start(EpisodeStart(GOALS, PLACED, FURNITURE), 1, 1)
    check_start(EpisodeStart((OpenGoal("drawer"),), furniture=FURNITURE), 0, 1)


@pytest.mark.parametrize(
    ("start", "said"),
    [
        (EpisodeStart((), PLACED), "no goal"),
        (EpisodeStart((PoseGoal("objekt", np.eye(4)),), PLACED), "goal 0 .* 'objekt'; .* object"),
        (EpisodeStart(GOALS, {"object": PlacedObject(5, np.eye(4))}), "index 5; the scene has 1"),
        (EpisodeStart(GOALS, {"object": PlacedObject(0, np.full((4, 4), np.nan))}), "no finite"),
        (EpisodeStart(GOALS, PLACED, (PlacedFurniture(1, np.zeros(3), np.eye(4)[0]),)), "index 1"),
        (
            EpisodeStart(GOALS, PLACED, (PlacedFurniture(0, np.full(3, np.inf), np.eye(4)[0]),)),
            "finite",
        ),
    ],
)
def test_what_does_not_fit_is_one_line(start, said):
    with pytest.raises(InputError, match=said):
        check_start(start, 1, 1)
