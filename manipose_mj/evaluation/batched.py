"""Episodes of a policy in batched worlds: all of a task's side by side, until each has ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.making import available_engine, from_pool
from manipose_mj.batch.state import State
from manipose_mj.batch.worlds import Worlds
from manipose_mj.errors import InputError
from manipose_mj.evaluation.config import BatchSettings, EvaluationConfig
from manipose_mj.evaluation.policy_settings import CONTROL_HZ, PolicySettings
from manipose_mj.evaluation.records import EpisodeResult
from manipose_mj.evaluation.rollout import ROUNDING
from manipose_mj.policies.loading import load_policy
from manipose_mj.policies.protocol import NOT_FINITE, ActionSpace
from manipose_mj.poses import Array
from manipose_mj.wire.address import shown

_LOOK_EVERY = 5  # actions between looks at whether all episodes have ended


@runtime_checkable
class BatchPolicy(Protocol):
    """A policy that can act in many worlds at once."""

    def act(self, observation: Mapping[str, Array]) -> Float[Array, "worlds n"]:
        """Actions of all worlds: a pure function of their observations, for `jax.jit`."""
        ...


@dataclass
class _Ends:
    """How the episodes ended, by world.

    Attributes: ended; success; once; diverged; overflowed; invalid, by an action that is no finite number; steps,
      control steps until then; decisions, actions until then; clipped, of these.
    """

    ended: np.ndarray
    success: np.ndarray
    once: np.ndarray
    diverged: np.ndarray
    overflowed: np.ndarray
    invalid: np.ndarray
    steps: np.ndarray
    decisions: np.ndarray
    clipped: np.ndarray


def batched_results(
    config: EvaluationConfig,
    batch: BatchSettings,
    episodes: Sequence[tuple[str, int]],
    crashed: Callable[[str, int, Exception], EpisodeResult],
) -> Iterator[EpisodeResult]:
    """The results of episodes, by task and index, a batch of worlds after the other.

    Args:
      config: Of the evaluation.
      batch: How many worlds, and on which engine.
      episodes: Their tasks and numbers.
      crashed: The result of an episode of a task that raised when its starts were drawn.

    Raises:
      InputError: The policy cannot act in many worlds, or fails at it, its rate does not divide the control steps', or
        the engine cannot run here.
    """
    settings = config.policy
    assert settings is not None, "batched worlds play policies"
    policy, hold = _policy(settings), _hold(settings)
    engine = available_engine(batch.engine)
    for task in sorted({task for task, _ in episodes}):
        numbers = [number for name, number in episodes if name == task]
        specs = [config.episode_spec(task, number) for number in numbers]
        try:
            pool = draw_pool(config.env_config(task), specs)
        except (InputError, OSError, MemoryError):
            raise
        except Exception as error:  # one broken task must not end the others
            for number in numbers:
                yield crashed(task, number, error)
            continue
        count = min(batch.worlds, len(numbers))
        worlds = from_pool(pool, count, engine, threads=config.jobs)
        _tell(policy, worlds, settings, task)
        for first in range(0, len(numbers), count):
            rows = list(range(first, min(first + count, len(numbers))))
            filled = rows + [rows[-1]] * (count - len(rows))
            started = time.perf_counter()
            ends = _played(worlds, policy, [pool.seeds[row] for row in filled], settings, hold)
            wall_s = (time.perf_counter() - started) / len(rows)
            for world, row in enumerate(rows):
                name = pool.starts[row].object_name
                seconds = pool.layout.timestep * pool.layout.substeps
                yield _result(config, task, numbers[row], name, ends, world, seconds, wall_s)
        worlds.close()


def _policy(settings: PolicySettings) -> BatchPolicy:
    policy = load_policy(settings.name, settings.arguments)
    if not isinstance(policy, BatchPolicy):
        raise InputError(
            f"--policy {shown(settings.name)}: has no method act, which batched worlds ask for all actions at once; leave "
            "out --engine"
        )
    return policy


def _hold(settings: PolicySettings) -> int:
    """For how many control steps an action is held."""
    hold = round(CONTROL_HZ / settings.hz)
    if abs(hold * settings.hz - CONTROL_HZ) > 1e-6:
        raise InputError(f"hz is {settings.hz:g}; batched worlds take a divisor of {CONTROL_HZ:g}")
    return hold


def _tell(policy: Any, worlds: Worlds, settings: PolicySettings, task: str) -> None:
    """What every policy is told at the start of an episode."""
    space = ActionSpace(
        worlds.lower.astype(float),
        worlds.upper.astype(float),
        worlds.pool.layout.control_mode,
        settings.hz,
    )
    with _naming(settings.name, "reset"):
        policy.reset(task=task, instruction="", seed=0, action_space=space)


def _played(
    worlds: Worlds, policy: BatchPolicy, seeds: list[int], settings: PolicySettings, hold: int
) -> _Ends:
    """Play until all episodes of these seeds have ended."""
    horizon = worlds.pool.layout.horizon
    several = _several(worlds, policy, settings.name, hold)
    state, ends = worlds.at(seeds), _no_ends(worlds.count)
    taken = 0
    while not ends.ended.all():
        state, (looks, clipped, invalid) = several(state)
        rows = zip(_unstacked(looks), *map(np.asarray, (clipped, invalid)), strict=True)
        for i, (now, over, no_action) in enumerate(rows):
            playing = ~ends.ended
            ends.clipped += playing & over
            held = (now["held_at"] > 0) & (settings.stop == "success")
            ending = playing & (now["terminated"] | now["truncated"] | held)
            ends.once |= playing & now["success_once"]
            success = now["success"] & ~no_action
            ends.success = np.where(ending, success | held, ends.success)
            ends.diverged |= ending & now["terminated"] & ~held
            ends.overflowed |= playing & now["overflowed"]
            ends.invalid |= ending & no_action
            steps = np.minimum((taken + i + 1 - no_action) * hold, horizon)
            ends.steps = np.where(ending, np.where(held, now["held_at"], steps), ends.steps)
            ends.decisions = np.where(ending, taken + i + 1, ends.decisions)
            ends.ended |= ending
        taken += _LOOK_EVERY
    return ends


_LOOKED_AT = ("terminated", "truncated", "success", "success_once", "overflowed", "held_at")


def _several(
    worlds: Worlds, policy: BatchPolicy, name: str, hold: int
) -> Callable[[State], tuple[State, Any]]:
    """Some actions in one call, with what each led to."""
    shape = (worlds.count, len(worlds.lower))

    def one(state: State, _: None) -> tuple[State, Any]:
        with _naming(name, "act"):
            action = jnp.asarray(policy.act(state.observation))
        if action.shape != shape:
            raise InputError(
                f"--policy {name}: act answered with shape {action.shape}; expected {shape}, worlds and numbers of an action"
            )
        invalid = ~jnp.isfinite(action).all(-1)
        beyond = jnp.abs(jnp.clip(action, worlds.lower, worlds.upper) - action).max(-1)
        after = worlds.step(state, action, hold)
        looks = {name: getattr(after, name) for name in _LOOKED_AT}
        return after, (looks, beyond > ROUNDING, invalid)

    return jax.jit(lambda state: jax.lax.scan(one, state, length=_LOOK_EVERY))


@contextmanager
def _naming(policy: str, method: str) -> Iterator[None]:
    """Whatever a stranger's method raises, as an `InputError` that names the policy."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"--policy {policy}: {method} failed ({reason[:300]})") from error


def _unstacked(looks: Mapping[str, Array]) -> list[dict[str, np.ndarray]]:
    arrays = {name: np.asarray(values) for name, values in looks.items()}
    return [{name: v[i] for name, v in arrays.items()} for i in range(_LOOK_EVERY)]


def _no_ends(count: int) -> _Ends:
    def no() -> np.ndarray:
        return np.zeros(count, bool)

    def none() -> np.ndarray:
        return np.zeros(count, int)

    return _Ends(no(), no(), no(), no(), no(), no(), none(), none(), none())


def _result(
    config: EvaluationConfig,
    task: str,
    episode: int,
    name: str,
    ends: _Ends,
    world: int,
    control_timestep: float,
    wall_s: float,
) -> EpisodeResult:
    steps, success = int(ends.steps[world]), bool(ends.success[world])
    failure, reason = "timeout", "not done at the time limit"
    if ends.diverged[world]:
        failure, reason = "physics", "the simulation diverged"
    if ends.invalid[world]:
        failure, reason = "policy", NOT_FINITE
    if ends.overflowed[world]:
        failure, reason = "physics", "the engine had too little room for the contacts"
        success = False
    if success:
        failure, reason = None, ""
    return EpisodeResult(
        task=task,
        episode=episode,
        seed=config.episode_seed(task, episode),
        object=name,
        pose_source=config.pose_source,
        mask_source=config.mask_source,
        success_once=bool(ends.once[world]),
        success_at_end=success,
        failure=failure,
        reason=reason,
        translation_error=None,
        rotation_error=None,
        steps=steps,
        sim_time=round(steps * control_timestep, 6),
        max_penetration=None,
        wall_s=wall_s,
        decisions=int(ends.decisions[world]),
        clipped_actions=int(ends.clipped[world]),
    )
