"""`clutter/stacked`: the target lies under others."""

from __future__ import annotations

import numpy as np

from manipose_mj.tasks.clutter.lying_pile import LyingPile
from manipose_mj.tasks.clutter.task import Clutter
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.goals import Goal, OnTableGoal


class ClutterStacked(Clutter):
    """Bring the target to its goal; what lies on it has to be moved, and nothing may fall off the table."""

    def choose_targets(
        self, rng: np.random.RandomState, lying: LyingPile, preview: Preview
    ) -> tuple[int, ...]:
        covered = [i for i in self.possible_targets(lying) if not lying.pile.uncovered[i]]
        return (int(rng.choice(covered)),) if covered else ()

    def more_goals(self, others: tuple[str, ...]) -> tuple[Goal, ...]:
        return tuple(OnTableGoal(name) for name in others)
