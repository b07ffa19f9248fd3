"""Success and reward of many episodes, whose goals need not be of one kind or number: the tasks' own functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.errors import InputError
from manipose_mj.poses import Array
from manipose_mj.tasks import pytrees
from manipose_mj.tasks.goals import Goal, RewardMode, Tolerance, reward, success
from manipose_mj.tasks.scene.state import SceneState

Answer = Callable[[tuple[Goal, ...], SceneState], Array]


class EpisodeGoals:
    """The goals of every start, those of one structure stacked."""

    def __init__(self, goals: Sequence[tuple[Goal, ...]]) -> None:
        """Args: goals: Of each start, by row."""
        for each in goals:
            for goal in each:
                pytrees.register(type(goal))
        structures: dict[Any, list[int]] = {}
        for row, each in enumerate(goals):
            shapes = tuple(np.shape(leaf) for leaf in jax.tree.leaves(each))
            structures.setdefault((jax.tree.structure(each), shapes), []).append(row)
        # Starts of other structures stand in with the first of this one; they are not looked at.
        self._stacked = []
        self._kind = np.zeros(len(goals), np.int32)
        for kind, rows in enumerate(structures.values()):
            self._kind[rows] = kind
            filled = [goals[row if row in set(rows) else rows[0]] for row in range(len(goals))]
            self._stacked.append(stack_trees(filled))

    def success(
        self, rows: Int[Array, " worlds"], state: SceneState, tolerance: Tolerance
    ) -> Bool[Array, " worlds"]:
        """Whether each world's goals are met."""
        return self._of_each(rows, state, lambda goals, own: success(goals, own, tolerance))

    def reward(
        self,
        rows: Int[Array, " worlds"],
        state: SceneState,
        tolerance: Tolerance,
        mode: RewardMode,
    ) -> Float[Array, " worlds"]:
        """Each world's reward."""
        return self._of_each(rows, state, lambda goals, own: reward(goals, own, tolerance, mode))

    def _of_each(self, rows: Int[Array, " worlds"], state: SceneState, answer: Answer) -> Array:
        """What `answer` says of each world's goals and state."""
        kinds, found = jnp.asarray(self._kind)[rows], None
        for kind, stacked in enumerate(self._stacked):
            try:
                own = jax.vmap(answer)(take(stacked, rows), state)
            except jax.errors.JAXTypeError as error:
                kinds_of = sorted({type(goal).__name__ for goal in stacked})
                raise InputError(
                    f"goals {', '.join(kinds_of)}: cannot be traced by JAX, as batched worlds do "
                    f"({type(error).__name__}); compute with `manipose_mj.poses.namespace(array)` in place of "
                    "numpy, and decide with `where` in place of `if`"
                ) from error
            found = own if found is None else jnp.where(kinds == kind, own, found)
        return found


def take(tree: Any, rows: Int[Array, " worlds"]) -> Any:
    """These rows of all leaves."""
    return jax.tree.map(lambda leaf: leaf[rows], tree)


def stack_trees(trees: Sequence[Any]) -> Any:
    """Trees of one structure as one whose leaves have a leading axis; real numbers in single precision."""

    def stacked(*leaves: Any) -> np.ndarray:
        array = np.stack([np.asarray(leaf) for leaf in leaves])
        return array.astype(np.float32) if array.dtype == float else array

    # All at once; `jnp.asarray` would compile a program for each.
    return jax.device_put(jax.tree.map(stacked, *trees))
