"""What a model is told of a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from manipose_mj.control.language.description import scene_text
from manipose_mj.control.language.destinations import named_destinations
from manipose_mj.control.language.reply import reply_schema
from manipose_mj.tasks.goals import PoseGoal, TakenOutGoal
from tests.control.language.scenes import kitchenette

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
