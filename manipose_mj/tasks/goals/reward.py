"""Success and reward over all goals of an episode: pure functions of the scene's state.

A task on the CPU and a batch of worlds call the same ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.poses import Array, namespace
from manipose_mj.tasks.goals.conditions import Tolerance
from manipose_mj.tasks.goals.goal import Goal
from manipose_mj.tasks.goals.stages import PLACED
from manipose_mj.tasks.scene.state import SceneState

RewardMode = Literal["sparse", "dense"]
_MOST_WITHOUT_SUCCESS = 0.999


def success(goals: Sequence[Goal], state: SceneState, tolerance: Tolerance) -> Bool[Array, "*b"]:
    """Whether every goal is met."""
    met = goals[0].met(state, tolerance)
    for goal in goals[1:]:
        met = met & goal.met(state, tolerance)
    return met


def reward(
    goals: Sequence[Goal], state: SceneState, tolerance: Tolerance, mode: RewardMode
) -> Float[Array, "*b"]:
    """1 where every goal is met; elsewhere 0 if sparse, or the progress so far, less than 1, if dense."""
    met = success(goals, state, tolerance)
    xp = namespace(met)
    if mode == "sparse" or (xp is np and met.all()):
        return xp.where(met, 1.0, 0.0)
    nearing = xp.minimum(progress(goals, state, tolerance), _MOST_WITHOUT_SUCCESS)
    return xp.where(met, 1.0, nearing)


def progress(goals: Sequence[Goal], state: SceneState, tolerance: Tolerance) -> Float[Array, "*b"]:
    """Progress towards all goals, in [0, 1].

    Where all are met it may still be less than 1, and `reward` is 1 all the same: an object that counts as at rest
    moves a little, a drawer that counts as shut stands open a little.

    Neighbours of one kind count side by side, in any order; different kinds one after the other, the
    next from where the one before is all but met: a drawer that must be shut in the end gains nothing
    by staying shut.
    """
    total, open_gate, groups = 0.0, True, 0
    for _, group in groupby(goals, key=type):
        each = [goal.progress(state, tolerance) for goal in group]
        xp = namespace(each[0])
        stacked = xp.stack(each, axis=0)
        value, done = xp.mean(stacked, axis=0), xp.all(stacked >= PLACED, axis=0)
        total = total + (xp.where(open_gate, value, 0.0) if groups else value)
        open_gate, groups = open_gate & done, groups + 1
    return total / groups
