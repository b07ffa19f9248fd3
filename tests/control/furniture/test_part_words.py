"""Words find the part that is meant, among parts of which some are missed or none."""

from __future__ import annotations

import numpy as np

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.furniture.part_words import Candidate, meant_part
from manipose_mj.poses import SymmetryGroup
from manipose_mj.tasks.instructions.names import part_words_among

# Across, outwards along x, down.
TURN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def part(name: str, y: float, z: float, kind: str = "slide") -> MovingPart:
    handle = PoseLabel(
        np.array([0.3, y, z]),
        TURN,
        "handle",
        np.array([0.1, 0.01, 0.01]),
        SymmetryGroup(np.eye(3)[None]),
    )
    axis = np.array([1.0, 0.0, 0.0]) if kind == "slide" else np.array([0.0, 0.0, 1.0])
    return MovingPart(name, Joint(kind, handle.origin, axis, (0.0, 0.3)), handle, None)


COLUMN = [part(f"drawer_{k}", 0.0, 0.1 + 0.15 * k) for k in range(5)]


def found(
    words: str, parts: list[MovingPart], confidences: list[float] | None = None
) -> str | None:
    sure = confidences or [0.7] * len(parts)
    index = meant_part(words, [Candidate(p, c) for p, c in zip(parts, sure, strict=True)])
    return None if index is None else parts[index].name


def test_every_part_is_found_by_its_own_words():
    row = [part("left", 0.2, 0.8, "hinge"), part("right", -0.2, 0.8, "hinge")]
    for each in [*COLUMN, *row]:
        assert found(part_words_among([*COLUMN, *row], each), [*COLUMN, *row]) == each.name


def test_a_part_of_little_confidence_does_not_change_the_order():
    stray = part("stray", 0.0, 0.95)
    assert found("top drawer", [*COLUMN[:3], stray], [0.7, 0.7, 0.7, 0.05]) == "drawer_2"


def test_what_was_missed_leaves_the_nearest():
    assert found("middle drawer", [COLUMN[0], COLUMN[2], COLUMN[3], COLUMN[4]]) in (
        "drawer_2",
        "drawer_3",
    )
    assert found("bottom drawer", COLUMN[1:]) == "drawer_1"


def test_where_one_was_missed_the_middle_one_is_in_the_middle_of_the_body():
    for missed in (0, 1, 3, 4):
        parts = [part for k, part in enumerate(COLUMN) if k != missed]
        sure = [0.7 if part is COLUMN[2] else 0.8 for part in parts]
        candidates = [Candidate(p, c) for p, c in zip(parts, sure, strict=True)]
        index = meant_part("middle drawer", candidates, "cabinet", body=(0.0, 0.8))
        assert index is not None and parts[index].name == "drawer_2"


def test_a_single_part_that_was_taken_for_another_kind_is_meant_still():
    assert found("door", [part("only", 0.0, 0.3)]) == "only"
    assert found("door", []) is None


def test_a_wide_front_is_a_drawers_though_all_were_taken_for_doors():
    doors = [part("one", 0.2, 0.3, "hinge"), part("other", -0.2, 0.3, "hinge")]
    wide = part("wide", 0.0, 0.6, "hinge")
    candidates = [Candidate(each, 0.6, 0.8, 0.6) for each in doors] + [
        Candidate(wide, 0.3, 0.6, 0.35)
    ]
    assert meant_part("drawer", candidates) == 2
    assert meant_part("left door", candidates) == 1


def test_the_door_of_an_oven_is_above_a_drawer_and_below_its_knobs():
    below = Candidate(part("below", 0.0, 0.1, "hinge"), 0.2, 0.0, 0.1, 0.6)
    above = Candidate(part("above", 0.0, 0.7), 0.15, 0.0, 0.3, 0.6)
    knob = Candidate(part("knob", 0.3, 0.9, "hinge"), 0.5, 0.5, 0.6, 0.02)
    assert meant_part("door", [below, above, knob], "oven") == 1
    assert meant_part("door", [knob], "oven") == 0
    # Two knobs side by side may be taken for a bar, but a short one.
    row = Candidate(part("row", 0.1, 0.9, "hinge"), 0.5, 0.4, 0.6, 0.12)
    bar = Candidate(part("bar", 0.0, 0.7, "hinge"), 0.6, 0.0, 0.3, 0.45)
    assert meant_part("door", [bar, row], "oven") == 0
    assert meant_part("door", [row, below, bar], "oven") == 2
    # In a cupboard a wide, low front is a drawer's, wherever it is.
    assert meant_part("door", [below, above], "cabinet") == 0


def test_beside_the_bars_of_two_oven_doors_knobs_are_no_doors():
    left = Candidate(part("left", -0.4, 0.6, "hinge"), 0.12, 0.0, 0.3, 0.6)
    right = Candidate(part("right", 0.4, 0.6, "hinge"), 0.3, 0.0, 0.3, 0.5)
    knobs = [
        Candidate(part(f"knob_{k}", k / 10, 0.7, "hinge"), 0.6, 0.5, 0.5, 0.08) for k in (1, 4)
    ]
    candidates = [*knobs, right, left]
    assert meant_part("left door", candidates, "oven") == 3
    assert meant_part("right door", candidates, "oven") == 2
    assert meant_part("left door", knobs, "oven") == 0
    # In a cupboard they are other doors' and drawers'.
    assert meant_part("left door", candidates, "cabinet") != 3
