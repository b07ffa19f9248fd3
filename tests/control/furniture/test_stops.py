"""A stop is the end of a part, or a hand that slipped off."""

from __future__ import annotations

from manipose_mj.control.furniture.stops import Stops

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
