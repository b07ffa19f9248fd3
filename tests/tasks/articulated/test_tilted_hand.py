"""What lies flat behind a door is held tilted, where the hand has no room to come straight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.errors import InputError
from manipose_mj.tasks.articulated.cavity_placement import hand_towards, ways_in_hand
from manipose_mj.tasks.articulated.hand_room import STRAIGHT, TILTED
from manipose_mj.tasks.articulated.object_draw import with_cavity
from manipose_mj.tasks.articulated.registered import OPENABLES
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec


@pytest.fixture(scope="module")
def door() -> MovingPart:
    parts = catalogue.load("microwave", 4).parts
    return next(part for part in parts if part.cavity is not None)


@pytest.fixture(scope="module")
def remote() -> Asset:
    return catalogue.load("remote", 4)


def test_the_hand_is_tilted_only_where_it_does_not_come_straight(
    door: MovingPart, remote: Asset
) -> None:
    assert hand_towards(catalogue.load("mug", 0), door) == STRAIGHT
    assert hand_towards(remote, door) == TILTED and ways_in_hand(remote, door)


def test_drawers_are_reached_into_from_above(door: MovingPart, remote: Asset) -> None:
    assert door.cavity is not None
    drawer = replace(door, cavity=replace(door.cavity, moves_with_part=True))
    try:
        assert hand_towards(remote, drawer) == STRAIGHT
    except InputError:
        pytest.fail("a remote fits a microwave")


def test_flat_objects_are_drawn_where_they_are_asked_for_only(remote: Asset) -> None:
    """Seeds that name no object draw what they drew before."""
    draws = with_cavity(OPENABLES["microwave"].requested, taken=True, fillers=0)
    folders = tuple(str(catalogue.load(*each).folder) for each in (("microwave", 4), ("mug", 0)))
    task, rng = "articulated/take_out_microwave", np.random.RandomState(0)
    both = draws(EnvConfig(task, objects=(*folders, str(remote.folder))))
    drawn = {both(rng, EpisodeSpec()).assets[1].name for _ in range(10)}
    assert drawn == {"mug_000"}
    assert both(rng, EpisodeSpec(object="remote_004")).assets[1].name == "remote_004"
    alone = draws(EnvConfig(task, objects=(folders[0], str(remote.folder))))
    assert alone(rng, EpisodeSpec()).assets[1].name == "remote_004" and alone.strata()
