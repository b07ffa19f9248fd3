"""How much better a frame that nobody voted for must be judged, chosen on views that were trained on.

The judge is trained on frames of both kinds as often, but of those that are only related to the best one
most are wrong; what its judgement is worth then depends on the objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import jax
import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.ppf_jax.clouds import CloudBatch
from manipose_mj.ppf_jax.model import PoseModel, estimate_batch
from manipose_mj.ppf_jax.training import hypothesis_degrees

HANDICAPS = tuple(float(np.radians(degrees)) for degrees in (0.0, 2.5, 5.0, 10.0, 20.0, 40.0))


def choose_handicap(model: PoseModel, batches: Sequence[CloudBatch]) -> PoseModel:
    """The same networks with the handicap of `HANDICAPS` whose answers are least far off on average.

    Args:
      model: Trained.
      batches: Of one shape, of views that may be chosen by.
    """
    columns = []
    for index, batch in enumerate(batches):
        key = jax.random.key(index)
        found = estimate_batch(model, batch.points, batch.normals, batch.mask, key=key)
        columns.append((hypothesis_degrees(found, batch), found.doubt, found.related))
    degrees, doubt, related = (np.concatenate(column) for column in zip(*columns, strict=True))
    return with_handicap(model, least_off(degrees, doubt, related))


def least_off(
    degrees: Float[np.ndarray, "n h"],
    doubt: Float[np.ndarray, "n h"],
    related: Bool[np.ndarray, "n h"],
) -> float:
    """The handicap [rad] with the smallest mean error, the first of equal ones.

    Args:
      degrees: Error of each hypothesis of each cloud.
      doubt: How far off each is judged to be [rad].
      related: Which of them nobody voted for.
    """
    means = []
    for handicap in HANDICAPS:
        first = np.argmin(doubt + handicap * related, axis=1)
        means.append(np.mean(degrees[np.arange(len(first)), first]))
    return HANDICAPS[int(np.argmin(means))]


def with_handicap(model: PoseModel, handicap: float) -> PoseModel:
    """The same networks with another handicap [rad]."""
    refinement = replace(model.config.refinement, related_handicap=handicap)
    shaped = PoseModel(replace(model.config, refinement=refinement), rng=np.random.default_rng(0))
    return jax.tree.unflatten(jax.tree.structure(shaped), jax.tree.leaves(model))
