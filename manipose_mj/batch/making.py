"""Makes batched worlds from a task's name, as `suite.load` makes one."""

from __future__ import annotations

import importlib.util
import inspect
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal, Unpack

import jax

from manipose_mj.batch.capacity import Capacity
from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.starts import StartPool
from manipose_mj.batch.worlds import Worlds
from manipose_mj.errors import InputError, check_count, how_to_install, unknown_name
from manipose_mj.tasks.core.config import EnvConfig, EnvOptions, check_seed, env_config

ENGINES = ("auto", "c", "warp")
EngineName = Literal["auto", "c", "warp"]
DEFAULT_STARTS = 32
WARP_ON_CPU = (
    "MANIPOSE_WARP_ON_CPU"  # set: the engine `warp` runs without a GPU too, slowly, for tests
)


def make(
    task: str | EnvConfig,
    *,
    worlds: int,
    seed: int = 0,
    seeds: Sequence[int] | None = None,
    engine: EngineName = "auto",
    threads: int = 1,
    visual: bool = False,
    capacity: Capacity | None = None,
    **config: Unpack[EnvOptions],
) -> Worlds:
    """Many worlds of a registered task.

    Args:
      task: `"domain/name"`, or a configuration with all its options.
      worlds: How many.
      seed: The first of the seeds that the worlds' episodes have: `DEFAULT_STARTS` of them, or as many as there
        are worlds if these are fewer.
      seeds: These instead. Each is drawn once, by the CPU task's own reset, which takes 0.1 to 1 s.
      engine: `"c"`, MuJoCo on the CPU, bit for bit the task's physics; `"warp"`, MuJoCo Warp on an NVIDIA GPU;
        `"auto"`, the latter where it is.
      threads: Of the engine `c`, that step its worlds.
      visual: Keep the visual shapes of objects in the engine `warp`, for `Cameras`; it costs speed.
      capacity: Room of the engine `warp` for contacts and constraints; without it, from a probe of the starts.
      **config: Fields of `EnvConfig`: `obs_mode` (`state`, `pose`, or keys of these), `control_mode`, `reward_mode`,
        `objects` (or `"train"`, `"test"`, as `split`), `split`, `randomisation`, `sensors`, `latency`.

    Raises:
      InputError: A name or mode is unknown or cannot be batched, `seed` and `seeds` are given, or the engine cannot run
        here.
    """
    require_worlds(worlds)
    check_seed(seed)
    if seeds is not None and seed:
        raise InputError(f"seed is {seed} beside seeds; give seed or seeds")
    if seeds is None:
        seeds = range(seed, seed + min(worlds, DEFAULT_STARTS))
    elif not isinstance(seeds, Iterable) or isinstance(seeds, str):
        raise InputError(f"seeds is {seeds!r}; expected whole numbers, each once")
    chosen = available_engine(engine)
    if isinstance(task, EnvConfig) and config:
        raise InputError(f"{', '.join(config)} beside an EnvConfig; expected all options in it")
    described = task if isinstance(task, EnvConfig) else env_config(task, config, others=_OWN)
    pool = draw_pool(described, list(seeds))
    return from_pool(pool, worlds, chosen, threads=threads, visual=visual, capacity=capacity)


_OWN = tuple(
    name
    for name, parameter in inspect.signature(make).parameters.items()
    if parameter.kind is parameter.KEYWORD_ONLY
)


def from_pool(
    pool: StartPool | Path | str,
    worlds: int,
    engine: EngineName = "auto",
    *,
    threads: int = 1,
    visual: bool = False,
    capacity: Capacity | None = None,
) -> Worlds:
    """Many worlds whose starts are drawn already, or were saved in a file; arguments as of `make`.

    Raises:
      InputError: The file holds no pool, or the engine cannot run here.
    """
    require_worlds(worlds)
    check_count("threads", threads, least=1)
    if not isinstance(capacity, Capacity | None):
        raise InputError(f"capacity is {capacity!r}; expected a batch.Capacity, or None")
    chosen = available_engine(engine)
    if isinstance(pool, Path | str):
        pool = StartPool.load(pool)
    if chosen == "warp":
        from manipose_mj.batch.engine_warp import WarpEngine  # only where its libraries are

        return Worlds(pool, WarpEngine(pool, worlds, capacity, visual=visual), worlds)
    from manipose_mj.batch.engine_c import CEngine  # Numba is slow to load

    return Worlds(pool, CEngine(pool, worlds, threads=threads), worlds)


def require_worlds(worlds: int) -> None:
    """Raises InputError where there would be none, or no whole number."""
    check_count("worlds", worlds, least=1)


def available_engine(engine: str) -> Literal["c", "warp"]:
    """The engine of this name; of `"auto"`, the best that runs here.

    Raises:
      InputError: There is none of that name, or it cannot run here.
    """
    if engine not in ENGINES:
        raise unknown_name("engine", engine, ENGINES)
    missing = missing_for_warp()
    if engine == "warp" and missing:
        raise InputError(f"engine 'warp' cannot run here: {missing}")
    return "warp" if engine == "warp" or (engine == "auto" and not missing) else "c"


def missing_for_warp() -> str:
    """What the engine `warp` lacks on this machine, and how to get it, in one line; empty if nothing."""
    absent = [n for n in ("warp", "mujoco_warp") if importlib.util.find_spec(n) is None]
    if absent:
        return f"no module {' and '.join(absent)}; {how_to_install('gpu')}"
    if jax.default_backend() != "gpu" and not os.environ.get(WARP_ON_CPU):
        return f"JAX sees no NVIDIA GPU; on a machine with one, {how_to_install('gpu')}"
    return ""
