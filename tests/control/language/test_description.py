"""What a model is told of a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from manipose_mj.control.language.description import scene_text
from manipose_mj.control.language.destinations import named_destinations
from manipose_mj.control.language.reply import reply_schema
from manipose_mj.poses import compose
from manipose_mj.tasks.goals import PoseGoal, TakenOutGoal
from tests.control.language.scenes import counter, door, drawer, kitchenette, scene

AREA = TakenOutGoal("bowl", "microwave_door", np.array([0.4, -0.3]), np.array([0.05, 0.05]))


def test_what_nothing_has_shown_is_named_as_unseen_and_has_no_place_yet():
    seen = kitchenette()
    others = {name: obj for name, obj in seen.objects.items() if name != "bowl"}
    hidden = replace(seen, objects=others, unseen={"bowl": "soup_bowl"})
    goals = (AREA, PoseGoal("cup", seen.objects["cup"].label_pose))
    text = scene_text(hidden, named_destinations(goals, hidden))
    assert "- bowl: a soup bowl, unseen; a shut part or another object may hide it\n" in text
    assert "area of bowl" not in text and '"goal of cup"' in text
    assert "bowl" not in str(reply_schema(hidden, named_destinations(goals, hidden)))
    told = scene_text(seen, named_destinations(goals, seen))
    assert "unseen" not in told and '"area of bowl"' in told
    assert "- none\n" not in scene_text(replace(hidden, objects={}), {}).partition("Parts:")[0]


def parts_told(*parts) -> list[str]:
    """Names and words of parts, in the order of the text."""
    lines = scene_text(scene([], list(parts)), {}).partition("highest first:\n")[2].splitlines()
    return [line.partition(", its joint")[0] for line in lines if "joint" in line]


def test_parts_are_told_from_the_highest_down_in_words():
    heights = {"part_0": 0.15, "part_1": 0.75, "part_2": 0.3, "part_3": 0.6, "part_4": 0.45}
    assert parts_told(*(drawer(name, height) for name, height in heights.items())) == [
        "- part_1: top drawer",
        "- part_3: fourth drawer from the bottom",
        "- part_4: middle drawer",
        "- part_2: second drawer from the bottom",
        "- part_0: bottom drawer",
    ]


def test_words_of_the_instruction_come_first():
    """One drawer was missed: the second from the top is the middle one all the same."""
    middle = replace(drawer("middle_drawer", 0.6), called="middle drawer")
    others = [drawer("part_0", 0.15), drawer("part_1", 0.75), drawer("part_2", 0.45)]
    assert parts_told(middle, *others, drawer("part_3", 0.3)) == [
        "- part_1: top drawer",
        "- middle_drawer: middle drawer",
        "- part_2: drawer",
        "- part_3: second drawer from the bottom",
        "- part_0: bottom drawer",
    ]


def test_pieces_of_furniture_have_words_of_their_own():
    upper, lower = drawer("upper", 0.5), drawer("lower", 0.2)
    elsewhere = compose(np.eye(3), upper.base_pose[:3, 3] + [0.0, 1.0, 0.0])
    other = replace(drawer("other", 0.3), base_pose=elsewhere)
    told = parts_told(upper, lower, other, door("door"))
    assert told == [
        "- door: door",
        "- upper: top drawer",
        "- other: drawer",
        "- lower: bottom drawer",
    ]


def test_colours_tell_objects_apart_that_have_no_names():
    lines = scene_text(counter(), {}).splitlines()
    assert [line.partition(" 0.")[0] for line in lines[1:4]] == [
        "- clutter_0: a can, blue,",
        "- object: a can, red and white,",
        "- clutter_1: a mug, red,",
    ]
    assert "- bowl: a bowl, 0.06 x" in scene_text(kitchenette(), {})  # nobody knows
