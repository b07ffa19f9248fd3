"""A stop is the end of a part, or a hand that slipped off."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from manipose_mj.control.furniture.estimated_furniture import EstimatedFurniture
from manipose_mj.control.furniture.stops import Stops, Swings
from manipose_mj.poses import compose
from tests.control.furniture.synthetic import FRONT
from tests.control.furniture.test_opened_part import DOOR, MODEL

USUAL = 0.32


def test_a_drawer_that_stops_short_has_to_stop_there_twice():
    stops = Stops()
    assert not stops.is_end("drawer", "slide", 0.19, USUAL)
    assert not stops.is_end("other_drawer", "slide", 0.19, USUAL)
    assert stops.is_end("drawer", "slide", 0.20, USUAL)


def test_a_second_stop_elsewhere_is_no_end():
    stops = Stops()
    assert not stops.is_end("drawer", "slide", 0.18, USUAL)
    assert not stops.is_end("drawer", "slide", 0.25, USUAL)


def test_a_stop_near_the_usual_end_is_one_and_a_stop_at_the_start_is_none():
    stops = Stops()
    assert stops.is_end("drawer", "slide", 0.31, USUAL)
    assert not stops.is_end("drawer", "slide", 0.05, USUAL)
    assert not stops.is_end("drawer", "slide", 0.05, USUAL)
    assert stops.is_end("door", "hinge", 1.5, 1.75)
    assert not stops.is_end("door", "hinge", 1.0, 1.75)


def test_a_door_that_goes_along_with_every_push_opens_further_until_it_stops():
    swings = Swings()
    assert swings.end("door", 1.0, 1.92) == 1.92  # nobody pushed it
    swings.pushed("door", 1.2)
    assert swings.end("door", 1.2, 1.92) == 1.92  # far from its usual end
    swings.pushed("door", 1.91)
    further = swings.end("door", 1.90, 1.92)
    assert further > 2.3
    assert swings.goes_on("door")
    # Swept shut by the arm on its way, it has not come to its end.
    swings.pushed("door", further)
    assert swings.end("door", 0.1, further) == further
    assert swings.goes_on("door")
    # Where the hand went all the way, a door that is a little short of that went along.
    swings.pushed("door", 2.7)
    assert swings.end("door", 2.64, further) == pytest.approx(np.pi)
    swings.pushed("door", 3.0)
    assert swings.end("door", 2.6, np.pi) == 2.6  # it stayed behind
    assert not swings.goes_on("door")


def test_a_door_that_stops_where_it_usually_does_opens_no_further():
    swings = Swings()
    swings.pushed("door", 1.91)
    assert swings.end("door", 1.75, 1.92) == 1.92
    assert not swings.goes_on("door")


def test_a_door_that_nothing_leads_any_further_is_as_open_as_it_goes():
    swings = Swings()
    swings.led("door", 1.9, 1.92)
    assert swings.goes_on("door")
    swings.ends("door")
    assert not swings.goes_on("door")


@pytest.mark.parametrize(("opening", "end"), [(1.3, 1.3), (0.0, 1.8)])
def test_what_stays_where_it_was_pushed_is_at_its_end_unless_it_is_shut(opening, end):
    task = SimpleNamespace(goals=(), furniture_masks=())
    furniture = EstimatedFurniture(task, None, None, (), None)
    furniture.model = MODEL.with_part(DOOR.at(opening))
    furniture.pushed("door", opening)
    (part,) = furniture.model.parts
    assert part.part.joint.range == (0.0, end)
    assert part.opening == opening


@pytest.mark.parametrize(
    ("opening", "then"), [(0.3, 2.0), (1.5, 3.1), (3.0, 3.2), (3.3, 3.6), (3.2, 0.0)]
)
def test_a_door_in_the_hand_is_open_by_more_than_half_a_turn(opening, then):
    task = SimpleNamespace(goals=(), furniture_masks=())
    furniture = EstimatedFurniture(task, None, None, (), None)
    furniture.model = MODEL.with_part(DOOR.at(opening))
    shut = compose(np.eye(3), np.array([FRONT + 0.05, -0.15, 0.5]))
    path = np.array([DOOR.motion(way) @ shut for way in np.linspace(opening, then, 30)])
    furniture.hold("door", path[0])
    for tcp_pose in path[1:]:
        furniture.follow(tcp_pose)
    assert furniture.model.parts[0].opening == pytest.approx(then, abs=1e-6)
    furniture.model = MODEL.with_part(DOOR.at(opening))
    furniture.hold("door", path[0])
    furniture.feel("door", path, stopped=False)
    assert furniture.model.parts[0].opening == pytest.approx(then, abs=0.01)
    furniture.follow(path[-1])
    assert furniture.model.parts[0].opening == pytest.approx(then, abs=0.01)
