"""Running the estimator of handles and joints over scenes, and fitting its confidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, PRNGKeyArray

from manipose_mj.ppf_jax.articulated.model import ArticulatedModel
from manipose_mj.ppf_jax.articulated_estimator import PartEstimate, estimate_rows
from manipose_mj.ppf_jax.data.articulated.cache import FRONT_VIEWS
from manipose_mj.ppf_jax.data.articulated.clouds import FurnitureCloud, FurnitureScene, fused_cloud
from manipose_mj.ppf_jax.evaluation.part_metrics import PartErrors, part_errors

BATCH = 16


_ROUNDS, _RIDGE = 30, 1e-2


class PartFinder(Protocol):
    """What is evaluated: finds the parts in clouds, as `ArticulatedEstimator` does."""

    def estimate_many(
        self, clouds: Sequence[FurnitureCloud], *, key: PRNGKeyArray, least: float
    ) -> list[list[PartEstimate]]:
        """Of each cloud the parts of at least this confidence."""
        ...


@dataclass(frozen=True)
class Evaluated:
    """What an estimator said about clouds.

    Attributes:
      errors: Of every part whose handle a cloud shows.
      false_positives: Estimates of no handle at all.
      clouds: How many there were.
    """

    errors: list[PartErrors]
    false_positives: int
    clouds: int


def scene_clouds(scenes: Sequence[FurnitureScene], *, fused: int = 1) -> list[FurnitureCloud]:
    """One cloud of each scene, of its first `fused` front views."""
    return [fused_cloud(scene, range(min(fused, FRONT_VIEWS))) for scene in scenes]


def evaluated(
    estimator: PartFinder,
    clouds: Sequence[FurnitureCloud],
    *,
    least: float = 0.5,
    seed: int = 0,
) -> Evaluated:
    """Errors over clouds.

    Args:
      estimator: Whose.
      clouds: At least one.
      least: Confidence from which on an estimate counts.
      seed: Of what the estimator draws.
    """
    errors, false_positives = [], 0
    for start in range(0, len(clouds), BATCH):
        some = list(clouds[start : start + BATCH])
        # The last batch is filled up, so that all have one shape.
        filled = some + [clouds[0]] * (BATCH - len(some))
        key = jax.random.fold_in(jax.random.key(seed), start)
        found = estimator.estimate_many(filled, key=key, least=least)
        for cloud, estimates in zip(some, found, strict=False):
            own, none = part_errors(cloud, estimates)
            errors += own
            false_positives += none
    return Evaluated(errors, false_positives, len(clouds))


def calibrated(model: ArticulatedModel, clouds: Sequence[FurnitureCloud]) -> ArticulatedModel:
    """The model with a confidence that is the probability of a handle's being there, and in its place.

    Args:
      model: Trained.
      clouds: Of furniture that it was trained on.
    """
    rows, right = [], []
    for start in range(0, len(clouds) - BATCH + 1, BATCH):
        some = clouds[start : start + BATCH]
        for cloud, found in zip(
            some, estimate_rows(model, some, key=jax.random.key(start)), strict=True
        ):
            evidence, sound = _scored(cloud, found)
            rows.append(evidence)
            right.append(sound)
    fitted = _logistic(np.concatenate(rows), np.concatenate(right))
    return eqx.tree_at(lambda m: m.calibration, model, jnp.asarray(fitted, jnp.float32))


def _scored(
    cloud: FurnitureCloud, found: dict[str, np.ndarray]
) -> tuple[Float[np.ndarray, "k e"], Bool[np.ndarray, "k"]]:
    """The evidence for each estimate, and whether it is the nearest to a handle and within 5 cm."""
    from manipose_mj.ppf_jax.data.articulated.clouds import handle_poses

    apart = np.linalg.norm(handle_poses(cloud)[:, None, :3, 3] - found["handle"][:, :3, 3], axis=-1)
    sound = np.zeros(len(found["handle"]), bool)
    sound[apart.argmin(axis=1)[apart.min(axis=1) < 0.05]] = True
    return found["evidence"], sound


def _logistic(
    features: Float[np.ndarray, "n e"], right: Bool[np.ndarray, "n"]
) -> Float[np.ndarray, "weights"]:
    """Logistic regression by Newton's method; the constant first."""
    design = np.concatenate([np.ones((len(features), 1)), features], axis=1)
    weights = np.zeros(design.shape[1])
    for _ in range(_ROUNDS):
        likely = 1 / (1 + np.exp(-np.clip(design @ weights, -30, 30)))
        curvature = (design * (likely * (1 - likely))[:, None]).T @ design
        slope = design.T @ (right - likely) - _RIDGE * weights
        weights += np.linalg.solve(curvature + _RIDGE * np.eye(len(weights)), slope)
    return weights
