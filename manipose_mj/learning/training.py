"""A training: starts of a task, worlds on an engine, updates until the time is up, and a file."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.making import EngineName, available_engine, from_pool
from manipose_mj.batch.starts import Layout, StartPool
from manipose_mj.errors import InputError
from manipose_mj.learning import grip
from manipose_mj.learning.frames import FRAMES, frame_of
from manipose_mj.learning.network import NetworkConfig
from manipose_mj.learning.ppo import Learner, Ppo, PpoConfig, Progress
from manipose_mj.learning.trained import Trained
from manipose_mj.storage.cache_file import new_cache_file
from manipose_mj.storage.staging import staging
from manipose_mj.tasks.core.config import EnvConfig, Objects

POLICY_FILE, CURVE_FILE = "policy.npz", "curve.json"
_AT_ONCE = 4  # updates between looks at the clock
# Of a training that goes on: of actions at first, and features that the normalisation has seen.
_SPREAD, _SEEN = 0.35, 1e6
Row = dict[str, float]


@dataclass(frozen=True)
class TrainingConfig:
    """What is trained, and for how long.

    Attributes:
      task: One that opens or shuts a drawer or door, or that is about an object and no furniture.
      worlds: At the same time.
      starts: Episodes that the worlds begin with, of the seeds from `first_start` on.
      first_start: The first of these seeds.
      seed: Of the networks and of what they try.
      minutes: That the updates may take, compiling included.
      updates: At most; None: as many as there is time for.
      until: Share of the episodes that succeed at their end with which the training stops; None: never.
      episode: Length of an episode [s], shorter than the task's.
      engine: Of the physics.
      threads: Of the engine `c`; nothing that is learnt depends on them.
      objects: Furniture; None: the built-in pieces for training.
      policy: A trained one to go on from, whose actor and normalisation are kept; None: from nothing.
      ppo: How to learn.
    """

    task: str
    worlds: int = 1024
    starts: int = 512
    first_start: int = 0
    seed: int = 0
    minutes: float = 8.0
    updates: int | None = None
    until: float | None = None
    episode: float = 12.0
    engine: EngineName = "auto"
    threads: int = 1
    objects: Objects | None = None
    policy: Path | None = None
    ppo: PpoConfig = PpoConfig()


def training_pool(
    config: TrainingConfig,
    path: Path | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> StartPool:
    """The starts, read from a file if it is there, otherwise drawn and written to it.

    One start is drawn first: what cannot be trained is refused before the others are drawn.

    Args:
      config: Of the training.
      path: Of the file; None: they are kept nowhere.
      on_progress: Called with the number of starts drawn and that of all.

    Raises:
      InputError: The task is none that can be trained, the worlds are too few, an episode is shorter than an action, the
        policy to go on from is none or about something else, or the file is of another task.
    """
    config.ppo.require_worlds(config.worlds)
    if path is not None and path.exists():
        pool = StartPool.load(path)
        horizon = _checked_horizon(config, pool.layout, path)
    else:
        env_config = EnvConfig(
            config.task,
            obs_mode=grip.OBS_MODE,
            control_mode=grip.CONTROL_MODE,
            reward_mode="dense",
            objects=config.objects,
        )
        seeds = range(config.first_start, config.first_start + config.starts)
        pool = draw_pool(env_config, seeds[:1])
        horizon = _checked_horizon(config, pool.layout, path)
        if len(seeds) > 1:
            pool = draw_pool(env_config, seeds, on_progress=on_progress)
        if path is not None:
            pool.save(path)
    return replace(pool, layout=replace(pool.layout, horizon=horizon))


def _checked_horizon(config: TrainingConfig, layout: Layout, path: Path | None) -> int:
    """Control steps in an episode of a training, once all has been checked that does not need every start.

    Raises:
      InputError: The layout or the policy to go on from does not fit the training, or an episode is shorter than an
        action; `path` names the starts.
    """
    modes = (grip.OBS_MODE, grip.CONTROL_MODE, "dense")
    if (layout.obs_mode, layout.control_mode, layout.reward_mode) != modes or (
        layout.task != config.task
    ):
        raise InputError(f"{path}: its starts are of another task or mode; draw them again")
    _policy_before(config, frame_of(config.task, layout.frames))
    control_timestep = layout.timestep * layout.substeps
    steps = round(config.episode / control_timestep)
    if steps < config.ppo.hold:
        raise InputError(
            f"episode is {config.episode:g} s; expected the time of an action at least, {config.ppo.hold * control_timestep:g} s"
        )
    return min(steps, layout.horizon)


def _policy_before(config: TrainingConfig, frame: str) -> Trained | None:
    """The policy to go on from, if there shall be one.

    Raises:
      InputError: It is none, or was trained in another frame than this one.
    """
    if config.policy is None:
        return None
    before = Trained.load(config.policy)
    if before.frame != frame:
        raise InputError(
            f"{config.policy}: was trained on {before.task}, about {FRAMES[before.frame].NEEDS}; {config.task} takes "
            f"a policy about {FRAMES[frame].NEEDS}"
        )
    return before


def check_folder(out: Path, policy: Path | None = None) -> None:
    """See that a training can write into a folder, before it spends minutes.

    Args:
      out: The folder.
      policy: From which the training goes on; one in `out` may be replaced.

    Raises:
      InputError: It cannot be written, or holds another policy.
    """
    kept = out / POLICY_FILE
    if kept.exists() and not (policy is not None and policy.exists() and policy.samefile(kept)):
        raise InputError(
            f"{kept}: is there already; choose another --out, or go on from it by --policy"
        )
    new = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        with staging(kept):
            pass
        for folder in new:
            folder.rmdir()
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{out}: cannot write there ({reason}); choose another --out") from None


def train(
    config: TrainingConfig,
    pool: StartPool,
    out: Path,
    on_progress: Callable[[Row], None] = lambda row: None,
) -> Trained:
    """Learn, and write the policy and its curve.

    Args:
      config: What and how.
      pool: Its starts.
      out: Folder to write to.
      on_progress: Called with each new row of the curve.

    Raises:
      InputError: The engine cannot run here, the updates need more worlds, or the policy to go on from is none, or another task's.
    """
    ppo = config.ppo
    name = frame_of(config.task, pool.layout.frames)
    before = _policy_before(config, name)
    started = time.monotonic()
    worlds = from_pool(pool, config.worlds, available_engine(config.engine), threads=config.threads)
    frame = FRAMES[name]
    learning = Ppo(worlds, frame.features, frame.command, grip.ACTIONS, ppo)
    learner = learning.begin(jax.random.key(config.seed))
    if before is not None:
        learner = _going_on(learner, before)
    rows: list[Row] = []
    updates, actions = 0, config.worlds * ppo.steps
    trained = _trained(config, pool, learner)
    while config.updates is None or updates < config.updates:
        count = _AT_ONCE if config.updates is None else min(_AT_ONCE, config.updates - updates)
        learner, progress = learning.improve(learner, count)
        updates += count
        row = _row(progress) | {
            "updates": updates,
            "actions": updates * actions,
            "seconds": time.monotonic() - started,
        }
        rows.append(row)
        on_progress(row)
        trained = _trained(config, pool, learner)
        _write(out, trained, config, pool, rows)
        enough = config.until is not None and row["succeeded"] >= config.until
        if enough or row["seconds"] > 60 * config.minutes:
            break
    worlds.close()
    return trained


def _going_on(learner: Learner, before: Trained) -> Learner:
    """A learner with the actor of a training; the critic, which its file does not hold, knows nothing yet."""
    spread = jnp.full_like(learner.network.log_spread, jnp.log(_SPREAD))
    network = eqx.tree_at(
        lambda net: (net.actor, net.log_spread), learner.network, (before.network.actor, spread)
    )
    count = jnp.asarray(_SEEN, jnp.float32)
    return learner._replace(
        network=network, normaliser=eqx.tree_at(lambda n: n.count, before.normaliser, count)
    )


def _trained(config: TrainingConfig, pool: StartPool, learner: Learner) -> Trained:
    network = learner.network
    sizes = NetworkConfig(network.actor.in_size, network.actor.out_size)  # pyright: ignore[reportArgumentType]
    layout = pool.layout
    hz = 1 / (config.ppo.hold * layout.substeps * layout.timestep)
    frame = frame_of(config.task, layout.frames)
    return Trained(
        network, learner.normaliser, sizes, round(hz, 6), config.task, config.seed, frame
    )


def _row(progress: Progress) -> Row:
    """Of some updates: shares of the episodes that ended, and means."""
    found = {name: np.asarray(values, float) for name, values in progress._asdict().items()}
    ended = max(found["ended"].sum(), 1.0)
    shares = ("succeeded", "once", "overflowed")
    row = {name: found[name].sum() / ended for name in shares}
    row |= {name: found[name].sum() for name in ("ended", "diverged")}
    row |= {name: found[name].mean() for name in ("reward", "change", "rate", "spread")}
    return {name: float(value) for name, value in row.items()}


def _write(
    out: Path, trained: Trained, config: TrainingConfig, pool: StartPool, rows: list[Row]
) -> None:
    out.mkdir(parents=True, exist_ok=True)
    trained.save(out / POLICY_FILE)
    said: dict[str, Any] = asdict(config)
    said["policy"] = None if config.policy is None else str(config.policy)
    # Of the starts that there were: those of a pool that was read may be others than the configuration's.
    for name in ("starts", "first_start", "objects"):
        del said[name]
    objects = sorted({start.object_name for start in pool.starts})
    starts = {"seeds": list(pool.seeds), "objects": objects}
    with new_cache_file(out / CURVE_FILE) as scratch:
        scratch.write_text(json.dumps({"config": said, "starts": starts, "rows": rows}, indent=1))
