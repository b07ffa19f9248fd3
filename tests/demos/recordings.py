"""What the tests of demonstrations record: few episodes of a quick task, on three objects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from manipose_mj.demos.record import RecordConfig

TASK = "single_object/target_pose"
OBJECTS = ("mug_000", "chips_can_000", "box_000")


def config(out: Path, **options: Any) -> RecordConfig:
    return RecordConfig(TASK, out, **{"episodes": 2, "objects": OBJECTS, **options})
