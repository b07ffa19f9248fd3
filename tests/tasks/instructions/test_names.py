"""Words for parts, places and attitudes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import MovingPart
from manipose_mj.poses import SymmetryGroup, rotation_about
from manipose_mj.tasks.articulated.part_choice import kind_of
from manipose_mj.tasks.instructions import sentence
from manipose_mj.tasks.instructions.names import (
    attitude_words,
    direction_words,
    level_words,
    part_words,
    place_words,
)
from manipose_mj.tasks.instructions.sentence import instruction
from tests.few_objects import load

UP = np.array([0.0, 0.0, 1.0])
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@pytest.mark.parametrize("name", ["cabinet_000", "cabinet_003", "microwave_000", "oven_007"])
def test_no_two_parts_of_a_piece_have_the_same_words(name):
    asset = catalogue.load_by_name(name)
    words = [part_words(asset, part) for part in asset.parts if part.handle is not None]
    assert len(set(words)) == len(words) > 0
    assert all("drawer" in each or "door" in each for each in words)


def _drawer(template: MovingPart, name: str, sideways: float, height: float) -> MovingPart:
    assert template.handle is not None
    right = np.cross(-template.handle.rotation[:, 1], UP)
    handle = replace(template.handle, origin=sideways * right + height * UP)
    return replace(template, name=name, handle=handle)


def test_rows_and_columns_are_told_apart_as_seen_from_the_front():
    cabinet = catalogue.load_by_name("cabinet_000")
    drawer = next(part for part in cabinet.parts if part.joint.kind == "slide")
    places = [(x, z) for z in (0.1, 0.3, 0.5, 0.7) for x in (-0.2, 0.2)]
    parts = tuple(_drawer(drawer, f"d{i}", *place) for i, place in enumerate(places))
    chest = replace(cabinet, parts=parts)
    assert [part_words(chest, part) for part in parts] == [
        "bottom left drawer",
        "bottom right drawer",
        "second left drawer from the bottom",
        "second right drawer from the bottom",
        "third left drawer from the bottom",
        "third right drawer from the bottom",
        "top left drawer",
        "top right drawer",
    ]
    five = replace(cabinet, parts=tuple(_drawer(drawer, f"f{i}", 0.0, i / 5) for i in range(5)))
    assert part_words(five, five.parts[2]) == "middle drawer"
    assert part_words(five, five.parts[3]) == "fourth drawer from the bottom"
    column = replace(cabinet, parts=parts[0:6:2])
    assert [part_words(column, part) for part in column.parts] == [
        "bottom drawer",
        "middle drawer",
        "top drawer",
    ]


def test_places_are_told_from_the_robot():
    assert level_words(np.array([0.5, -0.123])) == "50 cm ahead, 12 cm to the right"
    assert place_words(np.array([0.5, 0.1, 0.07])) == "50 cm ahead, 10 cm to the left and 7 cm up"


@pytest.mark.parametrize(
    ("direction", "words"),
    [
        ((0, 0, 1), "up"),
        ((0, 0, -1), "down"),
        ((1, 0, 0), "straight ahead"),
        ((-1, 0, 0), "back at the robot"),
        ((0, 1, 0), "90 degrees to the left"),
        ((1, -1, 0), "45 degrees to the right"),
    ],
)
def test_directions_have_words(direction, words):
    assert direction_words(np.array(direction, float)) == words


def test_attitudes_are_told_by_the_label():
    can, mug = catalogue.load_by_name("chips_can_000"), catalogue.load_by_name("mug_000")
    box = catalogue.load_by_name("box_000")
    flipped = rotation_about(np.array([1.0, 0.0, 0.0]), np.pi) @ UPRIGHT
    assert attitude_words(can, UPRIGHT) == "upright"
    assert attitude_words(can, flipped).startswith("upside down")
    assert attitude_words(mug, UPRIGHT) == "upright, its front pointing straight ahead"
    assert attitude_words(mug, np.eye(3)) == "lying, its top pointing straight ahead"
    assert attitude_words(box, np.eye(3)) == (
        "its longest side pointing straight ahead, its second 90 degrees to the left"
    )
    flat = replace(
        box.label, extents=box.label.extents[[2, 0, 1]]
    )  # as a notebook's across its covers
    assert attitude_words(replace(box, label=flat), np.eye(3)) == (
        "its longest side pointing 90 degrees to the left, its second up"
    )
    quarters = [
        rotation_about(np.array([1.0, 0.0, 0.0]), turn) for turn in np.arange(4) * np.pi / 2
    ]
    post = replace(box, label=replace(box.label, symmetry=SymmetryGroup(np.array(quarters))))
    assert attitude_words(post, UPRIGHT).startswith("upright")
    assert attitude_words(post, flipped).startswith("upside down")


def test_a_flap_and_a_door_have_other_words():
    oven, cabinet = (catalogue.load_by_name(name) for name in ("oven_007", "cabinet_003"))
    flap = next(part for part in oven.parts if part.handle is not None)
    door = next(part for part in cabinet.parts if kind_of(part) == "door")
    lower, upper = _drawer(door, "door", 0.0, 0.3), _drawer(flap, "flap", 0.0, 0.7)
    piece = replace(cabinet, parts=(lower, upper))
    assert [part_words(piece, part) for part in piece.parts] == ["bottom door", "top door"]


@pytest.mark.parametrize(
    ("task", "words"),
    [
        ("store_microwave", "into the microwave, then shut the door of the microwave"),
        ("take_out_cabinet_door", "out of the cabinet and set it down"),
        ("store_middle_drawer", "into the middle drawer of the cabinet, then shut the middle"),
    ],
)
def test_doors_hold_nothing_themselves(task, words):
    environment = load("articulated", task, seed=1)
    environment.reset()
    assert words in instruction(environment.task)


@pytest.mark.parametrize(
    ("task", "words"), [("store", "behind the"), ("take_out", "from behind the")]
)
def test_of_several_doors_one_is_named(task, words, monkeypatch):
    environment = load("articulated", f"{task}_cabinet_door", seed=1)
    environment.reset()
    monkeypatch.setattr(sentence, "part_words", lambda asset, part: "left door")
    assert f" {words} left door of the cabinet" in instruction(environment.task)
