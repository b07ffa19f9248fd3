"""Print how fast batched worlds step beside MuJoCo Playground's `PandaPickCube` on MuJoCo Warp, in one process, in turns.

python benchmarks/batch/playground_comparison.py [--worlds 8192 32768] [--objects box_000] [--modes WARP ...] [--pool FILE]

Needs an NVIDIA GPU and `pip install playground==0.2.0`. Both make ten physics steps of 2 ms in a control step, and random
actions, each held for 25. Playground in its default configuration has room for the contacts of 2,048 worlds; its best is the
fastest graph mode with room for all. Its `step` is timed bare, without a wrapper that ends and begins episodes; ours begins
them anew. Its solver makes at most 5 iterations, and of its robot only the fingers and the hand's capsule collide. So a row
more steps our scene as MJX does, bare, along the set-points of ours. Medians of the turns. Playground's and MJX's kernels are
compiled one after another: a minute or two each from an empty cache; each first turn is told as it ends.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from manipose_mj import batch
from manipose_mj.batch.row_fields import RowFields
from manipose_mj.console.process import compile_at_once_on_gpus
from manipose_mj.evaluation.statistics import machine
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING

TASK = "single_object/target_pose"
TURNS = 5
HELD = 25
SPREAD = 0.6  # of our joint targets about home [rad]
PHYSICS_STEP, SUBSTEPS = 0.002, 10
CONTACTS, ROWS = 24, 128  # Playground's own room for a world
PLAYGROUND = "Playground"
MODES = ("JAX", "WARP", "WARP_STAGED", "WARP_STAGED_EX")


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
    parser.add_argument(
        "--pool", type=Path, help="drawn starts of ours, as throughput.py writes them"
    )
    parser.add_argument("--modes", nargs="*", choices=MODES, default=MODES, help="of graphs")
    parser.add_argument("--no-mjx", action="store_true", help="leave out our scene stepped by MJX")
    parser.add_argument("--steps", type=int, default=50, help="control steps in a turn")
    arguments = parser.parse_args()
    compile_at_once_on_gpus()
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
    source = arguments.pool or tuple(arguments.objects)
    makers: list[Callable[[], Runner]] = [lambda: ours(count, source, arguments.steps)]
    for mode in (None, *arguments.modes):
        makers.append(lambda mode=mode: playground(count, mode, arguments.steps))
    if not arguments.no_mjx:
        makers.append(lambda: mjx_of_ours(count, source, arguments.steps))
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
        print(f"{runner.name}: first turn after {first[runner.name]:.0f} s", file=sys.stderr)
    rates = in_turns(runners)
    own = rates[runners[0].name]
    for runner in runners:
        rate = rates[runner.name]
        print(
            f"| {count:,} | {runner.name} | {rate:,.0f} | {rate / own:.2f} | {first[runner.name]:.0f} |"
        )
    others = [rates[runner.name] for runner in runners if runner.name.startswith(PLAYGROUND)]
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


def ours(count: int, source: Path | tuple[str, ...], steps: int, engine: Any = "warp") -> Runner:
    """Batched worlds with observations, reward, success and auto-reset."""
    worlds, actions = worlds_and_actions(count, source, steps, engine)
    roll = jax.jit(lambda state: worlds.rollout(actions, state))
    state = worlds.reset(jax.random.key(0))
    return Runner("ours", lambda: roll(state), count * steps, worlds.close)


def worlds_and_actions(
    count: int, source: Path | tuple[str, ...], steps: int, engine: Any
) -> tuple[batch.Worlds, Any]:
    """Ours, of drawn starts or of objects, and random joint targets."""
    if isinstance(source, Path):
        worlds = batch.from_pool(source, count, engine)
    else:
        seeds = range(min(count, 16))
        worlds = batch.make(
            TASK, worlds=count, seeds=seeds, engine=engine, objects=source, reward_mode="dense"
        )
    layout = worlds.pool.layout
    assert (layout.timestep, layout.substeps) == (PHYSICS_STEP, SUBSTEPS), layout
    held = -(-steps // HELD)
    noise = jax.random.uniform(jax.random.key(1), (held, count, 8), minval=-1.0)
    center = np.append(HOME, MAX_OPENING / 2)
    targets = center + noise * np.append(np.full(7, SPREAD), MAX_OPENING / 2)
    return worlds, jnp.repeat(targets, HELD, axis=0)[:steps]


def mjx_of_ours(count: int, source: Path | tuple[str, ...], steps: int) -> Runner:
    """The physics of our scene alone, stepped by MJX: its first start's model in every world."""
    worlds, actions = worlds_and_actions(count, source, steps, "warp")

    def one(state: Any, action: Any) -> tuple[Any, Any]:
        after = worlds.step(state, action)
        return after, after.simulation["ctrl"]

    begun = worlds.reset(jax.random.key(0))
    set_points = jax.jit(lambda state: jax.lax.scan(one, state, actions)[1])(begun)
    set_points = jax.block_until_ready(set_points)
    model, room = RowFields(worlds.pool).model, worlds.engine.capacity  # pyright: ignore[reportAttributeAccessIssue]
    worlds.close()
    return bare_mjx(model, room, begun.simulation, set_points)


def bare_mjx(
    model: mujoco.MjModel, room: batch.Capacity, begun: Any, set_points: Any, mode: str = "WARP"
) -> Runner:
    """MJX's steps along given set-points.

    Args:
      model: Of every world.
      room: For contacts and rows.
      begun: `qpos`, `qvel` and `ctrl` to begin with, with an axis of worlds.
      set_points: Of each control step and world.
      mode: Of graphs.
    """
    import warp as wp  # pyright: ignore[reportMissingImports]
    from mujoco import mjx

    graphs = getattr(wp.JaxCallableGraphMode, mode)
    on_device = mjx.put_model(model, impl="warp", graph_mode=graphs)
    steps, count = set_points.shape[:2]
    contacts = math.ceil(room.contacts * count)

    def begin(qpos: Any, qvel: Any, ctrl: Any) -> Any:
        data = mjx.make_data(
            model, impl="warp", naconmax=contacts, naccdmax=contacts, njmax=room.constraints
        )
        return data.replace(qpos=qpos, qvel=qvel, ctrl=ctrl)

    def control_step(data: Any, ctrl: Any) -> Any:
        data = data.replace(ctrl=ctrl)
        step = jax.lax.scan(
            lambda data, _: (mjx.step(on_device, data), None), data, length=SUBSTEPS
        )
        return step[0]

    def one(data: Any, ctrl: Any) -> tuple[Any, None]:
        return jax.vmap(control_step)(data, ctrl), None

    roll = jax.jit(lambda data: jax.lax.scan(one, data, set_points)[0].qpos)
    data = jax.jit(jax.vmap(begin))(begun["qpos"], begun["qvel"], begun["ctrl"])
    name = f"MJX on our scene, bare, {mode}"
    return Runner(name, lambda: roll(data), count * steps, jax.clear_caches)


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
    name = f"{PLAYGROUND}, {'default' if mode is None else f'room for all, {mode}'}"
    return Runner(name, lambda: roll(state), count * steps, jax.clear_caches)


if __name__ == "__main__":
    main()
