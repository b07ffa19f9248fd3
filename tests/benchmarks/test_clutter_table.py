"""The clutter table: scenes of test objects of all categories that repeat, and rows that count right."""

from __future__ import annotations

from benchmarks.clutter_table import OBJECTS, Outcome, scene_objects, table
from manipose_mj.assets import categories


def test_scenes_are_test_objects_of_as_many_categories_and_repeat():
    names = scene_objects(0, 3)
    assert names == scene_objects(0, 3) != scene_objects(1, 3)
    found = [categories.find(name) for name in names]
    assert len({category for category, _ in found}) == len(names) == OBJECTS
    assert all(categories.category_row(c).split(index) == "test" for c, index in found)


def test_many_scenes_hold_every_rigid_category():
    seen = {name.rpartition("_")[0] for scene in range(60) for name in scene_objects(0, scene)}
    rigid = {row.name for row in categories.CATALOGUE.values() if row.object_type != "articulated"}
    assert seen == rigid


def test_rows_count_starts_and_successes_and_name_failures():
    outcomes = [
        Outcome("stacked", 1, 101, False, "plan: no way", 30.0),
        Outcome("pick", 0, 0, True, "", 10.0),
        Outcome("pick", 1, 100, False, "no start: none of 16 piles", 0.0),
        Outcome("stacked", 0, 1, True, "", 20.0),
    ]
    lines = list(table(outcomes))
    assert lines[2].startswith("| `clutter/pick` | 1 | 1 of 1 |")
    assert lines[3].startswith("| `clutter/stacked` | 0 | 1 of 2 |") and "| 25 |" in lines[3]
    assert lines[5:] == [
        "- `clutter/pick`, scene 1, seed 100: no start: none of 16 piles",
        "- `clutter/stacked`, scene 1, seed 101: plan: no way",
    ]
