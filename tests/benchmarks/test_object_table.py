"""The table of objects: lines that name what does not count, and summaries that count right."""

from __future__ import annotations

from benchmarks.object_table import Row, line_of, summary_of

TASK = "single_object/target_pose"


def test_refusals_and_objects_that_are_not_graspable_do_not_count():
    rows = [
        Row(TASK, "mug", True, 0, True, "", 2.0),
        Row(TASK, "mug", True, 1, False, "plan: no way", 2.0),
        Row(TASK, "bus", False, 0, False, "grasp: lost", 2.0),
        Row(TASK, "can_1", True, None, False, "DIR/can_1: can_1 is 101 mm wide", 0.0),
        Row(TASK, "can_2", True, None, False, "DIR/can_2: can_2 is 102 mm wide", 0.0),
    ]
    summary = summary_of(rows)
    assert summary.startswith(f"{TASK}: 1 of 2 (50%, 95 % interval")
    assert summary.endswith("2 refused: can_# is ### mm wide")
    assert "NO" in line_of(rows[1]) and "no way" in line_of(rows[1])
    assert "(bus)" in line_of(rows[2]) and "refused" in line_of(rows[3])
    assert summary_of([]) == "-: 0 of 0"
