"""Print how far one control step of engine `warp` is from engine `c`'s, from the same states.

python benchmarks/batch/batch_parity.py TASK [--objects NAME ...] [--worlds N] [--pool FILE] [--seeds SEED ...]
python benchmarks/batch/batch_parity.py TASK --plan-from seeds|DIR [--plans N] [--objects NAME ...]
python benchmarks/batch/batch_parity.py TASK --against c [--noise EPSILON] [--set NAME=NUMBER ...]

Hands go to the objects at any turn, close, and lift, on engine `c`; or plans of the baseline are played there. At several
moments both engines make one step from where it is. Engine `c` against itself, from states that are a little off or with
other options, tells what a difference means.
States in which the robot touches nothing and the others are counted apart.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from kept_starts import kept_starts
from solver_options import add_set, set_options

from manipose_mj import batch
from manipose_mj.batch.starts import StartPool
from manipose_mj.evaluation.statistics import machine, wilson_interval
from manipose_mj.robustness.plans import Plans, recorded_plans
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.simulation_state import (
    read_simulation,
    unflatten,
    write_simulation,
)

PHASE = 25  # control steps: above the object, down, closing, up
MOMENTS = (20, 45, 60, 70, 80, 95)
OF_A_PLAN = 10
QUANTILES = (0.5, 0.9, 0.99, 1.0)

# From worlds of engine `c`, states and what is done next in each.
Source = Callable[[batch.Worlds], Iterator[tuple[batch.State, jax.Array]]]


def main() -> None:
    """Print a table of quantiles."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task")
    parser.add_argument("--objects", nargs="+")
    parser.add_argument("--worlds", type=int, default=170)
    parser.add_argument("--starts", type=int, default=16)
    parser.add_argument("--pool", type=Path, help="drawn starts, read from here or written here")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0], help="of the hands' turns")
    parser.add_argument("--plan-from", metavar="seeds|DIR", help="states of the baseline's plans")
    parser.add_argument("--plans", type=int, default=100)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--against", choices=("warp", "c"), default="warp")
    parser.add_argument(
        "--noise",
        type=float,
        metavar="EPSILON",
        help="of the positions and velocities that another engine c steps from; 0: they are rounded to single precision",
    )
    add_set(parser, "of the other engine's models")
    arguments = parser.parse_args()
    if arguments.noise is not None and arguments.against != "c":
        parser.error("--noise is of another engine c; give --against c")
    print(f"{machine()}; {jax.devices()[0].device_kind}; MuJoCo {mujoco.__version__}")
    if arguments.plan_from is not None:
        objects = tuple(arguments.objects) if arguments.objects else None
        plans = recorded_plans(
            arguments.task,
            arguments.plan_from,
            arguments.plans,
            objects=objects,
            jobs=arguments.threads,
        )
        pool = kept_starts(arguments.pool, plans.config, [plan.seed for plan in plans.plans])
        worlds, sources = len(plans.plans), {"plans": partial(planned, plans)}
    else:
        config = EnvConfig(arguments.task, objects=arguments.objects)
        pool = kept_starts(arguments.pool, config, range(arguments.starts))
        pool = replace(pool, layout=replace(pool.layout, control_mode="pd_ee_pose"))
        worlds = arguments.worlds
        sources = {f"seed {seed}": partial(grasping, seed) for seed in arguments.seeds}
    reference = batch.from_pool(pool, worlds, "c", threads=arguments.threads)
    changed = replace(pool, scenes=tuple(copy(model) for model in pool.scenes))
    for model in changed.scenes:
        set_options(model, arguments.set)
    other = batch.from_pool(changed, worlds, arguments.against, threads=arguments.threads)
    if arguments.against == "warp":
        given = partial(_of_warp, pool)
    else:
        given = partial(_of_c, pool, arguments.noise, np.random.default_rng(0))
    compare(reference, other, given, sources)


def compare(
    reference: batch.Worlds,
    other: batch.Worlds,
    given: Callable[[batch.State], Any],
    sources: Mapping[str, Source],
) -> None:
    """Make the steps and print the differences, of all sources together; first, each source's states touched alike.

    Args:
      reference: Of engine `c`.
      other: Of the engine that it is compared with.
      given: From a state of `reference`, the simulation of `other`.
      sources: By their names.
    """
    rows: dict[str, list[np.ndarray]] = {}
    for source, states in sources.items():
        of_source: list[np.ndarray] = []
        for state, action in states(reference):
            after = reference.step(state, action)
            same = state._replace(simulation=given(state), identity=other.identity)
            differences = _differences(after, other.step(same, action))
            of_source.append(differences["alike"])
            for name, values in differences.items():
                rows.setdefault(name, []).append(values)
        alike = np.concatenate(of_source)
        print(f"{source}: {alike.sum()} of {len(alike)} touched alike", flush=True)
    reference.close()
    other.close()
    table = {name: np.concatenate(values) for name, values in rows.items()}
    touching = table.pop("touching")
    alike = table.pop("alike")
    print(f"{len(touching)} states, {touching.sum()} with the robot in contact")
    print("| what | states | " + " | ".join(f"{q:.0%}" for q in QUANTILES) + " |")
    print("|" + " --- |" * (2 + len(QUANTILES)))
    for name, values in table.items():
        for label, which in (("free", ~touching), ("in contact", touching)):
            if which.any():
                found = np.quantile(values[which], QUANTILES)
                print(f"| {name} | {label} | " + " | ".join(f"{v:.1e}" for v in found) + " |")
    low, high = wilson_interval(int(alike.sum()), len(alike))
    print(f"touched alike in {alike.mean():.2%} ({low:.2%} to {high:.2%})")


def grasping(seed: int, worlds: batch.Worlds) -> Iterator[tuple[batch.State, jax.Array]]:
    """States of hands that close about the objects at any turn, and lift; and the next action."""
    state = worlds.reset(jax.random.key(0))
    yaw = jax.random.uniform(jax.random.key(seed + 1), (worlds.count,), minval=-1.5, maxval=1.5)
    for step in range(max(MOMENTS) + 1):
        action = _action(state, yaw, step)
        if step in MOMENTS:
            yield state, action
        state = worlds.step(state, action)


def planned(plans: Plans, worlds: batch.Worlds) -> Iterator[tuple[batch.State, jax.Array]]:
    """States of the plans, `OF_A_PLAN` of each, evenly from its beginning to its end; and the next action."""
    actions = {plan.seed: plan.actions for plan in plans.plans}
    state = worlds.reset(jax.random.key(0))
    own = [actions[int(seed)] for seed in worlds.seeds(state)]
    share = (np.arange(OF_A_PLAN) + 0.5) / OF_A_PLAN
    moments = np.stack([(share * len(a)).astype(int) for a in own])  # (worlds, OF_A_PLAN)
    kept: list[tuple[batch.State, jax.Array] | None] = [None] * OF_A_PLAN
    for step in range(moments.max() + 1):
        action = jnp.asarray(np.stack([a[min(step, len(a) - 1)] for a in own]), jnp.float32)
        for number in np.flatnonzero((moments == step).any(axis=0)):
            now = jnp.asarray(moments[:, number] == step)
            kept[number] = _chosen(now, (state, action), kept[number] or (state, action))
        state = worlds.step(state, action)
    yield from (pair for pair in kept if pair is not None)


def _chosen(which: jax.Array, one: Any, other: Any) -> Any:
    """Of two trees: the worlds of `which` from the first, all others from the second."""

    def of(a: Any, b: Any) -> Any:
        if jnp.shape(a)[:1] != which.shape:  # of all worlds, not of each
            return a
        return jnp.where(which.reshape(-1, *[1] * (a.ndim - 1)), a, b)

    return jax.tree.map(of, one, other)


def _action(state: batch.State, yaw: jax.Array, step: int) -> jax.Array:
    """The TCP's pose and the opening."""
    phase = step // PHASE
    target = state.measurement.positions[:, 0]
    height = target[:, 2] + (0.12 if phase in (0, 3) else 0.01)
    opening = jnp.full_like(height, 0.08 if phase < 2 else 0.0)
    turn = jnp.stack([jnp.full_like(yaw, np.pi), jnp.zeros_like(yaw), yaw], axis=-1)
    place = jnp.stack([target[:, 0], target[:, 1], jnp.maximum(height, 0.02)], axis=-1)
    return jnp.concatenate([place, turn, opening[:, None]], axis=-1)


def _of_warp(pool: StartPool, state: batch.State) -> dict[str, jax.Array]:
    """The states of engine `c` as those of engine `warp`."""
    found: dict[str, list[np.ndarray]] = {n: [] for n in ("qpos", "qvel", "ctrl", "qacc_warmstart")}
    for _, data, _ in _simulations(pool, state):
        for name, values in found.items():
            values.append(np.array(getattr(data, name)))
    made = {name: jnp.asarray(np.stack(v), jnp.float32) for name, v in found.items()}
    return made | {"overflow": jnp.zeros(len(state.row), jnp.int32)}


def _of_c(
    pool: StartPool, noise: float | None, rng: np.random.Generator, state: batch.State
) -> jax.Array:
    """The states of engine `c`, with positions and velocities off by so much; 0: rounded to single precision."""
    if noise is None:
        return state.simulation
    found = []
    for model, data, words in _simulations(pool, state):
        for values in (data.qpos, data.qvel):
            if noise:
                values += noise * rng.standard_normal(len(values))
            else:
                values[:] = values.astype(np.float32)
        flat = read_simulation(model, data).flat()
        found.append(np.concatenate([flat.view(words.dtype), words[2 * len(flat) :]]))
    return jnp.asarray(np.stack(found))


def _simulations(
    pool: StartPool, state: batch.State
) -> Iterator[tuple[mujoco.MjModel, mujoco.MjData, np.ndarray]]:
    """Of each world of engine `c`: its model, its data, and the words that these were read from."""
    for row, words in zip(np.asarray(state.row), np.asarray(state.simulation), strict=True):
        model = pool.scenes[pool.starts[row].scene]
        data = mujoco.MjData(model)
        write_simulation(model, data, unflatten(model, data, words.view(float)))
        yield model, data, words


def _differences(one: batch.State, other: batch.State) -> dict[str, np.ndarray]:
    """Of each world: the largest of each kind."""
    a, b = one.measurement, other.measurement

    def largest(x: jax.Array, y: jax.Array) -> np.ndarray:
        difference = np.abs(np.asarray(x, float) - np.asarray(y, float))
        return difference.reshape(len(difference), -1).max(axis=1)

    touches = np.asarray(a.contacts).any(axis=(1, 2))
    return {
        "joint angle [rad]": largest(a.joints, b.joints),
        "joint velocity [rad/s]": largest(a.velocities, b.velocities),
        "object position [m]": largest(a.positions, b.positions),
        "object speed [m/s]": largest(a.speeds[..., :3], b.speeds[..., :3]),
        "touching": touches,
        "alike": np.all(np.asarray(a.contacts) == np.asarray(b.contacts), axis=(1, 2)),
    }


if __name__ == "__main__":
    main()
