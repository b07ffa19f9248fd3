"""The table of refusals: reasons without names and figures, counted by category."""

from __future__ import annotations

import pytest

from benchmarks.experiments.refusals import Refusal, cause_of, counted_tasks, lines_of
from manipose_mj.errors import InputError


def test_reasons_are_the_same_for_all_objects():
    wide = "{0}: too large for the gripper: {1} mm wide at its narrowest, the gripper opens 80 mm"
    causes = {cause_of(wide.format(*each), each[0]) for each in (("pot_004", 101), ("pan_004", 99))}
    assert causes == {
        "too large for the gripper: # mm wide at its narrowest, the gripper opens # mm"
    }
    fits = (
        "pot_004: measures 10 x 20 x 30 mm and fits the cavity of 'door' (1 x 2 x 3 mm) in no pose"
    )
    assert (
        cause_of(fits, "pot_004")
        == "measures # mm and fits the cavity of the part (# mm) in no pose"
    )
    unknown = "unknown object 'pot_004'; did you mean 'pan_004'?"
    assert cause_of(unknown, "pot_004") == "its whole category is too long"


def test_categories_are_counted_by_reason():
    refusals = [
        Refusal("a", "plate", "flat"),
        Refusal("b", "pot", "wide"),
        Refusal("c", "pot", "wide"),
    ]
    assert lines_of("domain/task", 9, refusals) == [
        "domain/task: refuses 3 of 9",
        "  2: wide: pot 2",
        "  1: flat: plate 1",
    ]


def test_tasks_are_named_or_fit_a_pattern():
    names = [spec.full_name for spec in counted_tasks(["single_object/*", "clutter/pick"])]
    assert "single_object/target_pose" in names and names[-1] == "clutter/pick"
    assert len(names) == len(set(names)) > 3
    assert not [s.name for s in counted_tasks(["*"]) if s.name.startswith(("open_", "close_"))]
    for wrong in ("nope", "articulated/open_oven", "nope/*"):
        with pytest.raises(InputError):
            counted_tasks([wrong])
