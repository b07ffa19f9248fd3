"""Print how fast batched worlds step beside MuJoCo Playground's `PandaPickCube` on MuJoCo Warp, in one process, in turns.

python benchmarks/batch/playground_comparison.py [--worlds 8192 32768] [--objects box_000]

Needs an NVIDIA GPU and `pip install playground==0.2.0`. Both make ten physics steps of 2 ms in a control step, and random
actions, each held for 25. Playground in its default configuration has room for the contacts of 2,048 worlds; its best is the
fastest graph mode with room for all. Its `step` is timed bare, without a wrapper that ends and begins episodes; ours begins
them anew. Its solver makes at most 5 iterations. Medians of the turns.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from manipose_mj import batch
from manipose_mj.evaluation.statistics import machine
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING

TASK = "single_object/target_pose"
TURNS = 5
HELD = 25
SPREAD = 0.6  # of our joint targets about home [rad]
PHYSICS_STEP, SUBSTEPS = 0.002, 10
CONTACTS, ROWS = 24, 128  # Playground's own room for a world
MODES = ("WARP", "WARP_STAGED", "WARP_STAGED_EX")


@dataclass(frozen=True)
class Runner:
    """Attributes: name; run, one turn; steps, environment steps in it; close."""

    name: str
    run: Callable[[], Any]
    steps: int
    close: Callable[[], None]


def main() -> None:
    """Print a table for each number of worlds."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--worlds", nargs="+", type=int, default=[8192, 32768])
    parser.add_argument("--objects", nargs="+", default=["box_000"])
    parser.add_argument("--steps", type=int, default=50, help="control steps in a turn")
    arguments = parser.parse_args()
    versions = (
        f"MuJoCo {mujoco.__version__}, JAX {jax.__version__}, Playground {version('playground')}"
    )
    print(f"{machine()}; {jax.devices()[0].device_kind}; {versions}")
    print("| worlds | what | environment steps/s | of ours | first turn [s] |")
    print("| ---: | --- | ---: | ---: | ---: |", flush=True)
    for count in arguments.worlds:
        compare(count, arguments)


def compare(count: int, arguments: argparse.Namespace) -> None:
    """Print the rows of so many worlds, and ours over the best of Playground's."""
    makers: list[Callable[[], Runner]] = [lambda: ours(count, arguments.objects, arguments.steps)]
    for mode in (None, *MODES):
        makers.append(lambda mode=mode: playground(count, mode, arguments.steps))
    runners, first = [], {}
    for make in makers:
        began = time.perf_counter()
        try:
            runner = make()
            jax.block_until_ready(runner.run())
        except Exception as error:  # whatever another package raises in one of its modes
            print(
                f"left out: {type(error).__name__}: {str(error).splitlines()[0][:200]}", flush=True
            )
            continue
        runners.append(runner)
        first[runner.name] = time.perf_counter() - began
    rates = in_turns(runners)
    own = rates[runners[0].name]
    for runner in runners:
        rate = rates[runner.name]
        print(
            f"| {count:,} | {runner.name} | {rate:,.0f} | {rate / own:.2f} | {first[runner.name]:.0f} |"
        )
    others = [rates[runner.name] for runner in runners[1:]]
    if others:
        print(f"{count:,} worlds: {own / max(others):.2f} times the best of Playground", flush=True)
    for runner in runners:
        runner.close()


def in_turns(runners: Sequence[Runner]) -> dict[str, float]:
    """Environment steps a second, the median of the turns."""
    seconds: dict[str, list[float]] = {runner.name: [] for runner in runners}
    for _ in range(TURNS):
        for runner in runners:
            began = time.perf_counter()
            jax.block_until_ready(runner.run())
            seconds[runner.name].append(time.perf_counter() - began)
    return {r.name: r.steps / statistics.median(seconds[r.name]) for r in runners}


def ours(count: int, objects: Sequence[str], steps: int, engine: Any = "warp") -> Runner:
    """Batched worlds with observations, reward, success and auto-reset."""
    worlds = batch.make(
        TASK,
        worlds=count,
        seeds=range(min(count, 16)),
        engine=engine,
        objects=tuple(objects),
        reward_mode="dense",
    )
    layout = worlds.pool.layout
    assert (layout.timestep, layout.substeps) == (PHYSICS_STEP, SUBSTEPS), layout
    held = -(-steps // HELD)
    noise = jax.random.uniform(jax.random.key(1), (held, count, 8), minval=-1.0)
    center = np.append(HOME, MAX_OPENING / 2)
    targets = center + noise * np.append(np.full(7, SPREAD), MAX_OPENING / 2)
    actions = jnp.repeat(targets, HELD, axis=0)[:steps]
    roll = jax.jit(lambda state: worlds.rollout(actions, state))
    state = worlds.reset(jax.random.key(0))
    return Runner("ours", lambda: roll(state), count * steps, worlds.close)


def playground(count: int, mode: str | None, steps: int) -> Runner:
    """`PandaPickCube` with our physics steps; mode: of graphs, with room for all; None: its default configuration."""
    from mujoco import mjx
    from mujoco_playground._src.manipulation.franka_emika_panda import (  # pyright: ignore[reportMissingImports]
        pick,
    )

    config = {"sim_dt": PHYSICS_STEP, "ctrl_dt": PHYSICS_STEP * SUBSTEPS}
    if mode is not None:
        room = CONTACTS * count
        config |= {"naconmax": room, "naccdmax": room, "njmax": ROWS}
    environment = pick.PandaPickCube(config_overrides=config)
    if mode is not None:
        import warp as wp  # pyright: ignore[reportMissingImports]

        environment._mjx_model = mjx.put_model(
            environment.mj_model, impl="warp", graph_mode=getattr(wp.JaxCallableGraphMode, mode)
        )
    assert environment.n_substeps == SUBSTEPS
    step = jax.vmap(environment.step)
    held = -(-steps // HELD)
    shape = (held, count, environment.action_size)
    actions = jax.random.uniform(jax.random.key(1), shape, minval=-1.0)
    actions = jnp.repeat(actions, HELD, axis=0)[:steps]

    @jax.jit
    def roll(state: Any) -> tuple[Any, Any]:
        def one(state: Any, action: Any) -> tuple[Any, Any]:
            after = step(state, action)
            return after, (after.reward, after.done)

        return jax.lax.scan(one, state, actions)

    state = jax.jit(jax.vmap(environment.reset))(jax.random.split(jax.random.key(0), count))
    name = f"Playground, {'default' if mode is None else f'room for all, {mode}'}"
    return Runner(name, lambda: roll(state), count * steps, jax.clear_caches)


if __name__ == "__main__":
    main()
