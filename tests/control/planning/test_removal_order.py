"""The search over what to move first: shortest orders, what blocks what blocks, and where it ends."""

from __future__ import annotations

import pytest

from manipose_mj.control.planning.removal_order import first_removals, smallest


def _blockers(**sets: list[str]):
    """Blockers written as words: `target=["ab", "c"]` is free without a and b, or without c."""
    return lambda name: tuple(frozenset(each) for each in sets.get(name, [""]))


@pytest.mark.parametrize(
    ("sets", "in_place", "first"),
    [
        ({"t": [""]}, "", ["t"]),
        ({"t": ["a"]}, "", ["a"]),
        ({"t": ["ab"]}, "", ["a", "b"]),  # in either order
        ({"t": ["ab", "c"]}, "", ["c", "a", "b"]),  # one move rather than two
        ({"t": ["a"], "a": ["b"], "b": ["c"]}, "", ["c"]),  # what lies on what lies on it
        ({"t": ["a", "bc"], "a": []}, "", ["b", "c"]),  # a cannot be taken at all
        ({"t": ["a"], "a": ["b"], "b": ["a"]}, "", []),  # each waits for the other
        ({"t": []}, "", []),
        ({"t": [""]}, "g", ["g"]),  # its place is taken
        ({"t": [""], "g": ["h"]}, "g", ["h"]),
        ({"t": ["a"], "a": ["t"]}, "", []),  # the target is not moved to free itself
        ({"t": ["abcdef"]}, "", []),  # more moves than it looks ahead
    ],
)
def test_the_shortest_orders_come_first(sets, in_place, first):
    assert first_removals("t", _blockers(**sets), frozenset(in_place)) == first


def test_only_what_matters_is_asked_for():
    asked = set()

    def blockers(name: str):
        asked.add(name)
        return _blockers(t=["a"], z=["y"])(name)

    assert first_removals("t", blockers) == ["a"]
    assert asked == {"t", "a"}


def test_a_crowd_ends_the_search_in_time():
    many = [f"o{k}" for k in range(14)]
    calls = []

    def blockers(name: str):
        calls.append(name)
        return (frozenset(many),) if name == "t" else (frozenset(),)

    assert first_removals("t", blockers) == []
    assert len(calls) < 100_000


def test_sets_that_contain_others_are_dropped():
    sets = [frozenset(each) for each in ("abc", "b", "ab", "cd", "b")]
    assert smallest(sets, 5) == (frozenset("b"), frozenset("cd"))
    assert smallest(sets, 1) == (frozenset("b"),)
