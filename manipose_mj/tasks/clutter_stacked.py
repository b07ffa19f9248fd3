"""`clutter/stacked`: the target lies under others."""

from __future__ import annotations

import numpy as np
from dm_control import mjcf

from manipose_mj.tasks.clutter import Clutter
from manipose_mj.tasks.goals import Goal, OnTableGoal
from manipose_mj.tasks.pile import Pile


class ClutterStacked(Clutter):
    """Bring the target to its goal; what lies on it has to be moved, and nothing may fall off the table."""

    buried = True

    def _choose(
        self, physics: mjcf.Physics, pile: Pile, random_state: np.random.RandomState
    ) -> tuple[int, ...]:
        covered = [i for i in self._possible(pile) if not pile.uncovered[i]]
        return (int(random_state.choice(covered)),) if covered else ()

    @property
    def goals(self) -> tuple[Goal, ...]:
        return (*super().goals, *(OnTableGoal(name) for name in self.neighbours))
