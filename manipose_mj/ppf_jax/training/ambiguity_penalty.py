"""The ambiguity penalty: how much better a frame that nobody voted for must score, chosen on training views.

The pose scorer is trained on frames of both kinds as often, but most of those that nobody voted for are
wrong; how far its score can be trusted then depends on the objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import jax
import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.ppf_jax.points.clouds import CloudBatch
from manipose_mj.ppf_jax.rigid.model import PoseModel, estimate_batch
from manipose_mj.ppf_jax.training.loop import hypothesis_degrees

PENALTIES = tuple(float(np.radians(degrees)) for degrees in (0.0, 2.5, 5.0, 10.0, 20.0, 40.0))


def choose_ambiguity_penalty(model: PoseModel, batches: Sequence[CloudBatch]) -> PoseModel:
    """The same networks with the penalty of `PENALTIES` whose estimates have the least mean error.

    Args:
      model: Trained.
      batches: Of one shape, of views that may be chosen by.
    """
    columns = []
    for index, batch in enumerate(batches):
        key = jax.random.key(index)
        found = estimate_batch(
            model, batch.points, batch.normals, batch.mask, key=key, eyes=batch.eyes
        )
        columns.append((hypothesis_degrees(found, batch), found.expected_error, found.ambiguous))
    degrees, expected_error, ambiguous = (
        np.concatenate(column) for column in zip(*columns, strict=True)
    )
    return with_ambiguity_penalty(model, best_penalty(degrees, expected_error, ambiguous))


def best_penalty(
    degrees: Float[np.ndarray, "n h"],
    expected_error: Float[np.ndarray, "n h"],
    ambiguous: Bool[np.ndarray, "n h"],
) -> float:
    """The penalty [rad] with the smallest mean error, the first of equal ones.

    Args:
      degrees: Error of each hypothesis of each cloud.
      expected_error: Expected rotation error of each [rad].
      ambiguous: Which of them nobody voted for.
    """
    means = []
    for penalty in PENALTIES:
        first = np.argmin(expected_error + penalty * ambiguous, axis=1)
        means.append(np.mean(degrees[np.arange(len(first)), first]))
    return PENALTIES[int(np.argmin(means))]


def with_ambiguity_penalty(model: PoseModel, penalty: float) -> PoseModel:
    """The same networks with another penalty [rad]."""
    refinement = replace(model.config.refinement, ambiguity_penalty=penalty)
    shaped = PoseModel(replace(model.config, refinement=refinement), rng=np.random.default_rng(0))
    return jax.tree.unflatten(jax.tree.structure(shaped), jax.tree.leaves(model))
