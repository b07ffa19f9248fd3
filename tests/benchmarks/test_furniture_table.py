"""The table of furniture: every part is played or named with the reason why not."""

from __future__ import annotations

from dataclasses import replace

from furniture_table import handled_parts, listed

from manipose_mj.assets import catalogue


def test_parts_without_a_handle_are_named():
    whole = catalogue.load("microwave", 0)
    (door,) = handled_parts(whole)
    assert [line.split()[0] for line in listed(whole, played=True)][0] == "played"
    bare = replace(whole, parts=(replace(door, name="door_0", handle=None),))
    assert not handled_parts(bare)
    (line,) = listed(bare, played=True)
    assert (
        line.startswith("skipped") and "door_0" in line and line.endswith("no handle in the data")
    )


def test_knobs_share_a_line_and_a_piece_without_doors_says_so():
    door = catalogue.load("microwave", 0).parts[0]
    knobs = tuple(replace(door, name=f"knob_{i}", handle=None) for i in range(3))
    lines = listed(replace(catalogue.load("microwave", 0), parts=knobs), played=False)
    assert "3 knobs" in lines[0] and lines[1].endswith("no drawer, door or lid moves")


def test_a_piece_whose_doors_have_names_of_their_own_is_not_said_to_have_none():
    door = catalogue.load("microwave", 0).parts[0]
    whole = replace(catalogue.load("microwave", 0), parts=(replace(door, name="left_door"),))
    assert not listed(whole, played=False)
