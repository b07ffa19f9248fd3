"""What tasks want, when it is met, and what nearing it is worth: pure functions of the scene's state."""

from __future__ import annotations

from manipose_mj.tasks.goals.cavity import InsideGoal, TakenOutGoal
from manipose_mj.tasks.goals.conditions import Tolerance
from manipose_mj.tasks.goals.goal import Goal, GoalFrame
from manipose_mj.tasks.goals.joint import OpenGoal, ShutGoal
from manipose_mj.tasks.goals.rest import (
    OnTableGoal,
    OrientationGoal,
    PoseGoal,
    TurnedGoal,
    UprightGoal,
)
from manipose_mj.tasks.goals.reward import RewardMode, progress, reward, success

__all__ = [
    "Goal",
    "GoalFrame",
    "InsideGoal",
    "OnTableGoal",
    "OpenGoal",
    "OrientationGoal",
    "PoseGoal",
    "RewardMode",
    "ShutGoal",
    "TakenOutGoal",
    "Tolerance",
    "TurnedGoal",
    "UprightGoal",
    "progress",
    "reward",
    "success",
]
