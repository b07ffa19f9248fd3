"""`clutter/pick` and `clutter/multi`: bring one named object of a pile, or several, to their goals."""

from __future__ import annotations

import numpy as np

from manipose_mj.tasks.clutter.lying_pile import LyingPile
from manipose_mj.tasks.clutter.task import Clutter
from manipose_mj.tasks.core.preview import Preview


class ClutterPick(Clutter):
    """Take the target out of the pile and set it down at its goal; the rest may go where it likes.

    Nothing lies on the target, and the hand can come to it from some side.
    """

    def choose_targets(
        self, rng: np.random.RandomState, lying: LyingPile, preview: Preview
    ) -> tuple[int, ...]:
        found = [i for i in self.possible_targets(lying) if lying.pile.uncovered[i]]
        return (int(rng.choice(found)),) if found else ()


class ClutterMulti(Clutter):
    """Bring two or three objects of the pile to their goals, in any order that works.

    What lies on a target is a target too, so that some order needs nothing else to be moved.
    """

    def choose_targets(
        self, rng: np.random.RandomState, lying: LyingPile, preview: Preview
    ) -> tuple[int, ...]:
        low, high = self.task_config.targets
        count = int(rng.randint(low, high + 1))
        possible = set(self.possible_targets(lying))
        chosen: list[int] = []
        for _ in range(count):
            # From the top: what lies on it is chosen already.
            found = [
                i
                for i in sorted(possible - set(chosen))
                if set(np.flatnonzero(lying.pile.supports[:, i])) <= set(chosen)
            ]
            if not found:
                return ()
            chosen.append(int(rng.choice(found)))
        # The names shall not tell the order.
        return tuple(int(i) for i in rng.permutation(chosen))
