"""Print how far one control step of engine `warp` is from engine `c`'s, from the same states.

python benchmarks/batch/batch_parity.py TASK [--objects NAME ...] [--worlds N] [--pool FILE]

Hands go to the objects, close, and lift, on engine `c`; at several moments both engines make one step from where it is.
States in which the robot touches nothing and the others are counted apart.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from manipose_mj import batch
from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.starts import StartPool
from manipose_mj.evaluation.statistics import machine
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.simulation_state import unflatten, write_simulation

PHASE = 25  # control steps: above the object, down, closing, up
MOMENTS = (20, 45, 60, 70, 80, 95)
QUANTILES = (0.5, 0.9, 0.99, 1.0)


def main() -> None:
    """Print a table of quantiles."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task")
    parser.add_argument("--objects", nargs="+")
    parser.add_argument("--worlds", type=int, default=170)
    parser.add_argument("--starts", type=int, default=16)
    parser.add_argument("--pool", type=Path)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--noslip", type=int)
    parser.add_argument("--impratio", type=float)
    arguments = parser.parse_args()
    if arguments.pool is None:
        config = EnvConfig(arguments.task, objects=arguments.objects)
        pool = draw_pool(config, range(arguments.starts))
    else:
        pool = StartPool.load(arguments.pool)
    for model in pool.scenes:
        if arguments.noslip is not None:
            model.opt.noslip_iterations = arguments.noslip
        if arguments.impratio is not None:
            model.opt.impratio = arguments.impratio
    pool = replace(pool, layout=replace(pool.layout, control_mode="pd_ee_pose"))
    print(f"{machine()}; {jax.devices()[0].device_kind}; MuJoCo {mujoco.__version__}")
    compare(pool, arguments.worlds, arguments.threads)


def compare(pool: StartPool, count: int, threads: int) -> None:
    """Make the steps and print the differences."""
    reference = batch.from_pool(pool, count, "c", threads=threads)
    other = batch.from_pool(pool, count, "warp")
    state = reference.reset(jax.random.key(0))
    yaw = jax.random.uniform(jax.random.key(1), (count,), minval=-1.5, maxval=1.5)
    rows: dict[str, list[np.ndarray]] = {}
    for step in range(max(MOMENTS) + 1):
        action = _action(state, yaw, step)
        after = reference.step(state, action)
        if step in MOMENTS:
            same = state._replace(simulation=_simulations(pool, state), identity=other.identity)
            found = other.step(same, action)
            for name, values in _differences(after, found).items():
                rows.setdefault(name, []).append(values)
        state = after
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
    print(f"touched and held alike in {alike.mean():.2%}")
    reference.close()


def _action(state: batch.State, yaw: jax.Array, step: int) -> jax.Array:
    """The TCP's pose and the opening."""
    phase = step // PHASE
    target = state.measurement.positions[:, 0]
    height = target[:, 2] + (0.12 if phase in (0, 3) else 0.01)
    opening = jnp.full_like(height, 0.08 if phase < 2 else 0.0)
    turn = jnp.stack([jnp.full_like(yaw, np.pi), jnp.zeros_like(yaw), yaw], axis=-1)
    place = jnp.stack([target[:, 0], target[:, 1], jnp.maximum(height, 0.02)], axis=-1)
    return jnp.concatenate([place, turn, opening[:, None]], axis=-1)


def _simulations(pool: StartPool, state: batch.State) -> dict[str, jax.Array]:
    """The states of engine `c` as those of engine `warp`."""
    found: dict[str, list[np.ndarray]] = {n: [] for n in ("qpos", "qvel", "ctrl", "qacc_warmstart")}
    for row, words in zip(np.asarray(state.row), np.asarray(state.simulation), strict=True):
        model = pool.scenes[pool.starts[row].scene]
        data = mujoco.MjData(model)
        write_simulation(model, data, unflatten(model, data, words.view(float)))
        for name, values in found.items():
            values.append(np.array(getattr(data, name)))
    made = {name: jnp.asarray(np.stack(v), jnp.float32) for name, v in found.items()}
    return made | {"overflow": jnp.zeros(len(state.row), jnp.int32)}


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
