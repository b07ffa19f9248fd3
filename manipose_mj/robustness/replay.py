"""Recorded plans played open loop in batched worlds, each of them another one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import ceil

import jax
import numpy as np

from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.making import EngineName, available_engine, from_pool
from manipose_mj.batch.starts import StartPool
from manipose_mj.batch.state import Transition
from manipose_mj.errors import InputError
from manipose_mj.robustness.plans import Plans
from manipose_mj.robustness.variation import Variation, Varied
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.core.start import EpisodeStart

AFTER = 25  # control steps after a plan's last, in which objects come to rest
_AT_ONCE = 512  # worlds: each has a model of its own


@dataclass(frozen=True)
class Replay:
    """One plan in one world.

    Attributes:
      plan: Seed of the episode that it was made in.
      drawn: What differs from that, by the names of `variation.DRAWN`.
      success: Whether the goals are met half a second after the plan's last set-point has come.
      once: Whether they were at any time until then.
      valid: Whether the physics counts: it did not diverge, and there was room for all contacts.
    """

    plan: int
    drawn: dict[str, float]
    success: bool
    once: bool
    valid: bool


def replays(
    plans: Plans,
    variation: Variation,
    worlds: int,
    *,
    seed: int = 0,
    engine: EngineName = "auto",
    threads: int = 1,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Replay]:
    """Play plans in so many worlds, equally many of each plan; the first of each is the world it was made in.

    Args:
      plans: Recorded.
      variation: What is drawn for the other worlds.
      worlds: How many in all.
      seed: Of the draws.
      engine: Of the physics.
      threads: Of the engine `c`.
      on_progress: Called with the number of worlds that have ended and that of all.

    Raises:
      InputError: There are fewer worlds than plans, or the engine cannot run here.
    """
    if worlds < len(plans.plans):
        raise InputError(f"{worlds} worlds for {len(plans.plans)} plans; expected one a plan")
    chosen = available_engine(engine)
    rng = np.random.RandomState(seed)
    ended: list[Replay] = []
    for part, size in _parts(plans, worlds):
        first = len(ended) < len(plans.plans)
        pool, drawn = _varied_pool(part, variation, size, rng, nominal=first)
        ended += _played(part, pool, drawn, chosen, threads)
        on_progress(len(ended), worlds)
    return ended


def _parts(plans: Plans, worlds: int) -> Iterator[tuple[Plans, list[int]]]:
    """Plans with the number of worlds of each, as many as are played at once."""
    count = len(plans.plans)
    left = [worlds // count + (i < worlds % count) for i in range(count)]
    each = max(_AT_ONCE // count, 1)
    while any(left):
        size = [min(each, n) for n in left]
        left = [n - m for n, m in zip(left, size, strict=True)]
        kept = [i for i, n in enumerate(size) if n]
        yield replace(plans, plans=tuple(plans.plans[i] for i in kept)), [size[i] for i in kept]


def _varied_pool(
    plans: Plans, variation: Variation, sizes: list[int], rng: np.random.RandomState, nominal: bool
) -> tuple[StartPool, list[dict[str, float]]]:
    drawn: list[dict[str, float]] = []
    waiting = iter(sizes)

    def vary(environment: TaskEnvironment, start: EpisodeStart) -> Iterator[EpisodeStart]:
        varied = Varied(environment, variation)
        for number in range(next(waiting)):
            other, values = varied.draw(start, rng, nominal=nominal and number == 0)
            drawn.append(values)
            yield other
        # The next plan's scene may be this one.
        environment.task.write(environment.physics, varied.compiled(start))

    pool = draw_pool(plans.config, [plan.seed for plan in plans.plans], vary)
    return pool, drawn


def _played(
    plans: Plans,
    pool: StartPool,
    drawn: list[dict[str, float]],
    engine: EngineName,
    threads: int,
) -> list[Replay]:
    actions = {plan.seed: plan.actions for plan in plans.plans}
    last = [
        len(actions[start.seed]) + AFTER + ceil(start.latency / pool.layout.substeps)
        for start in pool.starts
    ]
    steps = max(last)
    longer = replace(pool.layout, horizon=max(steps + 1, pool.layout.horizon))
    pool = replace(pool, layout=longer)
    worlds = from_pool(pool, len(pool.starts), engine, threads=threads)
    state = worlds.reset(jax.random.key(0))
    rows = np.asarray(state.row)
    sent = np.stack([_held(actions[start.seed], steps) for start in pool.starts])
    _, seen = worlds.rollout(np.swapaxes(sent[rows], 0, 1).astype(np.float32), state)
    worlds.close()
    found: list[Replay] = []
    for world in np.argsort(rows):
        row = rows[world]
        found.append(_outcome(seen, int(world), last[row], pool.starts[row].seed, drawn[row]))
    return found


def _held(actions: np.ndarray, steps: int) -> np.ndarray:
    """The last set-point held to the end."""
    return np.concatenate([actions, np.repeat(actions[-1:], steps - len(actions), axis=0)])


def _outcome(seen: Transition, world: int, last: int, seed: int, drawn: dict[str, float]) -> Replay:
    def of(field: jax.Array) -> np.ndarray:
        return np.asarray(field)[:last, world]

    valid = not (of(seen.terminated).any() or of(seen.overflowed).any())
    success = of(seen.success)
    return Replay(seed, drawn, bool(success[-1]) and valid, bool(success.any()) and valid, valid)
