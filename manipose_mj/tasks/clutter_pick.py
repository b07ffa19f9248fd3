"""`clutter/pick` and `clutter/multi`: bring one named object of a pile, or several, to their goals."""

from __future__ import annotations

import numpy as np
from dm_control import mjcf

from manipose_mj.tasks.clutter import Clutter
from manipose_mj.tasks.pile import Pile


class ClutterPick(Clutter):
    """Take the target out of the pile and set it down at its goal; the rest may go where it likes.

    Nothing lies on the target, and the hand can come to it from some side.
    """

    def _choose(
        self, physics: mjcf.Physics, pile: Pile, random_state: np.random.RandomState
    ) -> tuple[int, ...]:
        found = [i for i in self._possible(pile) if pile.uncovered[i]]
        return (int(random_state.choice(found)),) if found else ()


class ClutterMulti(Clutter):
    """Bring two or three objects of the pile to their goals, in any order that works.

    What lies on a target is a target too, so that some order needs nothing else to be moved.
    """

    def _choose(
        self, physics: mjcf.Physics, pile: Pile, random_state: np.random.RandomState
    ) -> tuple[int, ...]:
        low, high = self.task_config.targets
        count = int(random_state.randint(low, high + 1))
        possible = set(self._possible(pile))
        chosen: list[int] = []
        for _ in range(count):
            # From the top: what lies on it is chosen already.
            found = [
                i
                for i in sorted(possible - set(chosen))
                if set(np.flatnonzero(pile.supports[:, i])) <= set(chosen)
            ]
            if not found:
                return ()
            chosen.append(int(random_state.choice(found)))
        # The names shall not tell the order.
        return tuple(int(i) for i in random_state.permutation(chosen))
