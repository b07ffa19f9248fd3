"""Training: Adam over batches from anywhere, resumable, with curves as JSON."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PRNGKeyArray

from manipose_mj.errors import InputError
from manipose_mj.poses import rotation_angle
from manipose_mj.ppf_jax.points.clouds import CloudBatch
from manipose_mj.ppf_jax.points.symmetry import nearest_equivalent
from manipose_mj.ppf_jax.rigid.model import Estimates, EstimatingModel, PoseModel, estimate_batch
from manipose_mj.ppf_jax.training.losses import LossConfig
from manipose_mj.ppf_jax.training.saved_state import STATE_FILE, described, state_read
from manipose_mj.storage.staging import replacing

log = logging.getLogger(__name__)

CURVE_FILE = "curve.json"
# Batches from step `start` on, so that a resumed training sees what an unbroken one would have.
Batches = Callable[[int], Iterator[CloudBatch]]
Row = dict[str, float]


class Objective(Protocol):
    """The loss of one row of a batch, and its parts; hashable, for it is compiled in."""

    def __call__(
        self, model: Any, sample: CloudBatch, *, key: PRNGKeyArray
    ) -> tuple[Float[Array, ""], dict[str, Float[Array, ""]]]:
        """Both, for a model; `key` for what is drawn."""
        ...


@dataclass(frozen=True)
class TrainingConfig:
    """How a model is trained.

    Attributes:
      steps: In all; fewer where time runs out first.
      learning_rate: Of Adam, until `cooldown`.
      warmup: Steps over which it rises.
      cooldown: Share of the training over which it falls to nothing.
      weight_decay: Of Adam.
      seed: Of the first weights, the pairs and the frames.
      loss: What is asked of each cloud.
      log_every: Steps between rows of the curve.
      evaluate_every: Steps between evaluations on held-out batches.
      save_every: Seconds between saved states.
    """

    steps: int = 20_000
    learning_rate: float = 2e-3
    warmup: int = 100
    cooldown: float = 0.5
    weight_decay: float = 1e-4
    seed: int = 0
    loss: Objective = field(default_factory=LossConfig)
    log_every: int = 50
    evaluate_every: int = 1000
    save_every: float = 60.0


class TrainingState(eqx.Module):
    """All that a step changes."""

    model: Any
    optimizer: optax.OptState
    step: Array


def train(
    batches: Batches,
    model_config: Any,
    config: TrainingConfig,
    folder: Path,
    *,
    build: Callable[..., Any] = PoseModel,
    initial: Any = None,
    about: Mapping[str, Any] | None = None,
    held_out: Sequence[CloudBatch] = (),
    minutes: float | None = None,
    progress: Callable[[Row], None] | None = None,
) -> Any:
    """Train a model, or go on with one whose state the folder holds.

    The same seed and batches give the same curve on one CPU, unless `minutes` ends it. All devices
    of one kind share each batch where its size can be divided by their number.

    Args:
      batches: Gives the batches from a step on.
      model_config: What to train.
      config: How.
      folder: Where the state and the curve are kept.
      build: Makes the model from `model_config` and `rng`, its random numbers.
      initial: A model of the same sizes, whose weights to start from instead of random ones.
      about: What batches and `initial` are, as JSON: a state of others is not gone on from.
      held_out: Batches to measure on, of one shape.
      minutes: Ends the training, cooled down, if the steps do not; those of all calls together.
      progress: Told every row of the curve.

    Raises:
      InputError: The folder holds another training's state, or `initial` has other sizes.
    """
    model = build(model_config, rng=np.random.default_rng(config.seed))
    if initial is not None:
        model = with_weights_of(model, initial)
    stated = about or {}
    state, curve, earlier = _resumed(folder, model, config, stated)
    folder.mkdir(parents=True, exist_ok=True)
    start = int(state.step)
    began = saved = time.monotonic()
    parts: dict[str, Array] = {}

    def spent() -> float:
        return earlier + time.monotonic() - began

    def add_row(step: int, *, measured: bool) -> None:
        row = {"step": step, "seconds": round(spent(), 2)}
        row |= {name: float(value) for name, value in parts.items()}
        if held_out and measured:
            row |= evaluate(state.model, held_out)
        curve.append(row)
        log.info("%s", row)
        if progress is not None:
            progress(row)

    feed = batches(start)
    placed = _placement()
    for step in range(start, config.steps):
        share = step / config.steps
        if minutes is not None:
            share = max(share, spent() / (60 * minutes))
            if share >= 1:
                if parts:
                    if curve and curve[-1]["step"] == step - 1:
                        curve.pop()  # the same, maybe not measured
                    add_row(step - 1, measured=True)
                break
        rate = jnp.float32(learning_rate(config, step, share))
        state, parts = _step(state, placed(next(feed)), rate, config)
        last = step + 1 == config.steps
        if step % config.log_every == 0 or last:
            evaluated = step > 0 and step % config.evaluate_every == 0
            add_row(step, measured=last or evaluated)
        if time.monotonic() - saved > config.save_every:
            _save(folder, state, curve, config, stated, spent())
            saved = time.monotonic()
    _save(folder, state, curve, config, stated, spent())
    return state.model


def with_weights_of(model: Any, other: Any) -> Any:
    """The model with the weights of another of its sizes.

    Raises:
      InputError: The sizes differ.
    """
    mine, theirs = jax.tree.leaves(model), jax.tree.leaves(other)
    if [np.shape(leaf) for leaf in mine] != [np.shape(leaf) for leaf in theirs]:
        raise InputError("the weights are of models of other sizes; train again")
    leaves = [jnp.asarray(new, old.dtype) for old, new in zip(mine, theirs, strict=True)]
    return jax.tree.unflatten(jax.tree.structure(model), leaves)


def mean_weights(models: Sequence[Any]) -> Any:
    """The first model with the mean of all their weights.

    Raises:
      InputError: Their sizes differ.
    """
    alike = [jax.tree.leaves(with_weights_of(models[0], other)) for other in models]
    means = [jnp.mean(jnp.stack(leaves), axis=0) for leaves in zip(*alike, strict=True)]
    return jax.tree.unflatten(jax.tree.structure(models[0]), means)


def learning_rate(config: TrainingConfig, step: int, share: float) -> float:
    """Rises, holds, falls as a cosine over the last part.

    Args:
      config: Rates and lengths.
      step: From 0.
      share: Of the whole training that is done.
    """
    left = min(1.0, max(0.0, 1 - share) / config.cooldown)
    fall = 0.5 - 0.5 * float(np.cos(np.pi * left))
    return config.learning_rate * min(1.0, (step + 1) / config.warmup) * max(fall, 1e-3)


def evaluate(model: EstimatingModel, batches: Sequence[CloudBatch]) -> Row:
    """Errors of the best hypothesis before and after refinement, and of the best there is.

    Returns:
      Medians and means in deg and cm; `flips`, the share turned by more than 90 deg; `oracle_deg`,
      the mean if the right hypothesis were always picked; `confident_deg`, the mean over the
      four fifths that the model is surest of.
    """
    rows = []
    for index, batch in enumerate(batches):
        key = jax.random.key(index)
        several = {"eyes": batch.eyes} if np.any(batch.eyes) else {}
        found = estimate_batch(model, batch.points, batch.normals, batch.mask, key=key, **several)
        rows.append(jax.tree.map(np.asarray, _errors(found, batch)))
    degrees, metres, voted, confidence = (
        np.concatenate(column) for column in zip(*rows, strict=True)
    )
    best = degrees[:, 0]
    surest = np.argsort(-confidence)[: max(1, int(0.8 * len(best)))]
    return {
        "deg_median": float(np.median(best)),
        "deg_mean": float(np.mean(best)),
        "cm_median": float(100 * np.median(metres)),
        "cm_mean": float(100 * np.mean(metres)),
        "voted_deg_median": float(np.median(voted)),
        "oracle_deg": float(np.mean(np.min(degrees, axis=1))),
        "confident_deg": float(np.mean(best[surest])),
        "flips": float(np.mean(best > 90)),
    }


def hypothesis_degrees(found: Estimates, batch: CloudBatch) -> Float[np.ndarray, "b h"]:
    """How far each hypothesis of each cloud is turned from the nearest equivalent label."""
    return np.asarray(_errors(found, batch)[0])


@jax.jit
def _errors(found: Estimates, batch: CloudBatch) -> tuple[Array, Array, Array, Array]:
    """Degrees of every hypothesis, metres and degrees before refinement of the first, confidence."""

    def one(poses: Array, voted: Array, sample: CloudBatch) -> tuple[Array, Array, Array]:
        def angle(pose: Array) -> Array:
            truth = sample.pose[:3, :3]
            nearest = nearest_equivalent(pose[:3, :3], truth, sample.symmetry)
            return jnp.degrees(rotation_angle(pose[:3, :3], nearest))

        metres = jnp.linalg.norm(poses[0, :3, 3] - sample.pose[:3, 3])
        return jax.vmap(angle)(poses), metres, angle(voted[0])

    degrees, metres, voted = jax.vmap(one)(found.poses, found.voted, batch)
    return degrees, metres, voted, found.confidence[:, 0]


def _optimizer(config: TrainingConfig) -> optax.GradientTransformation:
    chain = optax.chain(
        optax.clip_by_global_norm(1.0),
        optax.scale_by_adam(b2=0.99),
        optax.add_decayed_weights(config.weight_decay),
    )
    return optax.flatten(chain)  # one vector compiles in half the time of sixty arrays


@eqx.filter_jit
def _step(
    state: TrainingState, batch: CloudBatch, rate: Float[Array, ""], config: TrainingConfig
) -> tuple[TrainingState, dict[str, Array]]:
    key = jax.random.fold_in(jax.random.key(config.seed), state.step)
    keys = jax.random.split(key, batch.points.shape[0])

    def loss(model: Any) -> tuple[Array, dict[str, Array]]:
        losses, parts = jax.vmap(lambda s, k: config.loss(model, s, key=k))(batch, keys)
        return jnp.mean(losses), jax.tree.map(jnp.mean, parts)

    (total, parts), gradient = eqx.filter_value_and_grad(loss, has_aux=True)(state.model)
    # One batch with a gradient that is no number must not end a training.
    sound = jnp.isfinite(optax.tree.norm(gradient))
    gradient = jax.tree.map(lambda g: jnp.where(sound, g, 0.0), gradient)
    updates, optimizer = _optimizer(config).update(
        gradient, state.optimizer, eqx.filter(state.model, eqx.is_array)
    )
    model = eqx.apply_updates(state.model, jax.tree.map(lambda u: -rate * u, updates))
    return TrainingState(model, optimizer, state.step + 1), {"loss": total, **parts}


def _placement() -> Callable[[CloudBatch], CloudBatch]:
    """Puts a batch on the device, or a part of it on each."""
    devices = jax.devices()
    mesh = jax.sharding.Mesh(np.array(devices), ("batch",))
    parted = jax.sharding.NamedSharding(mesh, jax.sharding.PartitionSpec("batch"))

    def place(batch: CloudBatch) -> CloudBatch:
        if len(devices) == 1 or len(batch) % len(devices):
            return jax.device_put(batch)
        return jax.device_put(batch, parted)

    return place


def _fresh(model: Any, config: TrainingConfig) -> TrainingState:
    optimizer = _optimizer(config).init(eqx.filter(model, eqx.is_array))
    return TrainingState(model, optimizer, jnp.zeros((), jnp.int32))


def _resumed(
    folder: Path, model: Any, config: TrainingConfig, about: Mapping[str, Any]
) -> tuple[TrainingState, list[Row], float]:
    """The state, the curve and the seconds that were spent on them."""
    fresh = _fresh(model, config)
    path = folder / STATE_FILE
    if not path.is_file():
        return fresh, [], 0.0
    with state_read(path, described(config, about, fresh.model.config)) as (file, header):
        curve = header["curve"]
        # States that do not say so were written soon after their last row.
        seconds = header.get("seconds", curve[-1]["seconds"] if curve else 0.0)
        return eqx.tree_deserialise_leaves(file, fresh), curve, float(seconds)


def _save(
    folder: Path,
    state: TrainingState,
    curve: list[Row],
    config: TrainingConfig,
    about: Mapping[str, Any],
    seconds: float,
) -> None:
    """The state with its curve in one file, so that they cannot disagree; the curve beside it."""
    stated = described(config, about, state.model.config)
    header = {
        "config": [stated["model"], stated["training"]],
        "about": stated["about"],
        "curve": curve,
        "seconds": seconds,
    }
    with replacing(folder / STATE_FILE) as scratch, open(scratch, "wb") as file:
        file.write(json.dumps(header).encode() + b"\n")
        eqx.tree_serialise_leaves(file, state)
    with replacing(folder / CURVE_FILE) as scratch:
        scratch.write_text(json.dumps(curve, indent=1) + "\n")
