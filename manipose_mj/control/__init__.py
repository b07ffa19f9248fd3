"""The baseline policy: perceive, plan symbolically, plan motions, act.

    from manipose_mj.control import Baseline, Step, plan_from_json

| folder | holds |
|---|---|
| `perception/` | estimates of the scene, from the simulator or from cameras |
| `furniture/` | furniture and surroundings, from clouds and from what the hand feels |
| `scene/` | estimates and planning scenes, which never change; collision queries |
| `grasping/` | choosing grasps of objects and handles; lifting, setting down, backing off |
| `motion/` | inverse kinematics, free paths, straight lines, timing |
| `planning/` | from goals to plans of `move_to`, `grasp_at`, `release` |
| `execution/` | from plans to actions, and what to do when one fails |
| `primitive_mode/` | the control mode `primitive`: an action is a whole motion |
| `conversion/` | recorded episodes, and their translation into other control modes |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from manipose_mj.control.baseline import Baseline
    from manipose_mj.control.conversion.convert import convert
    from manipose_mj.control.conversion.recording import Recording, record, replay
    from manipose_mj.control.perception.pose_sources import POSE_SOURCES
    from manipose_mj.control.perception.protocol import Perception
    from manipose_mj.control.planning.plan import (
        Plan,
        Step,
        plan_from_json,
        plan_schema,
        plan_to_json,
    )
    from manipose_mj.control.planning.planner import candidate_plans, make_plan
    from manipose_mj.control.primitive_mode.environment import (
        PrimitiveConfig,
        PrimitiveEnvironment,
    )
    from manipose_mj.control.scene.scene_estimate import (
        ObjectEstimate,
        PartEstimate,
        SceneEstimate,
    )

__all__ = [
    "POSE_SOURCES",
    "Baseline",
    "ObjectEstimate",
    "PartEstimate",
    "Perception",
    "Plan",
    "PrimitiveConfig",
    "PrimitiveEnvironment",
    "Recording",
    "SceneEstimate",
    "Step",
    "candidate_plans",
    "convert",
    "make_plan",
    "plan_from_json",
    "plan_schema",
    "plan_to_json",
    "record",
    "replay",
]

__getattr__ = lazy_exports(__name__, __file__)
