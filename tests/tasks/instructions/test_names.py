"""Words for parts, places and attitudes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import MovingPart
from manipose_mj.poses import rotation_about
from manipose_mj.tasks.instructions.names import (
    attitude_words,
    direction_words,
    level_words,
    part_words,
    place_words,
)

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
