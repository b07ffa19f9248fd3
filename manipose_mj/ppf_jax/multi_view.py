"""One object seen by several calibrated cameras: every view's hypotheses, scored in all of them.

Each view votes by itself, for the networks look from one point. The pose scorer then reads every hypothesis in every
view's cloud, free space included, and the hypothesis with the highest sum of log odds wins: what one camera cannot tell
from its flip another one may.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, PRNGKeyArray

from manipose_mj.errors import InputError
from manipose_mj.poses import invert
from manipose_mj.ppf_jax.confidence import Scores, alike, scores_of
from manipose_mj.ppf_jax.estimator import PoseEstimator, distinct_first, prepared_sample
from manipose_mj.ppf_jax.points.camera_frames import checked_frames
from manipose_mj.ppf_jax.points.cloud_input import AnyCloud, listed_clouds, seeds_of
from manipose_mj.ppf_jax.pose_estimate import PoseEstimate
from manipose_mj.ppf_jax.rigid.evidence import Evidence
from manipose_mj.ppf_jax.rigid.model import PoseModel, estimate_with_evidence, score_poses
from manipose_mj.ppf_jax.rigid.refinement import CONFIDENT_LEVEL, expected_rotation_error

_AT_ONCE = 24  # poses that are scored in one call: one compilation
_MOST = 8.0  # log odds that one view may have for or against a pose
_AMBIGUITY = 2.0  # log odds against what no view voted for

_estimate_with_evidence = jax.jit(estimate_with_evidence)
_score_poses = jax.jit(score_poses)


@dataclass(frozen=True)
class ScoredTogether:
    """All views' hypotheses, the likeliest first.

    Attributes:
      poses: `(h, 4, 4)`, `T_common_label` [m].
      extents: `(h, 3)` [m].
      log_odds: `(h,)`, of being within 15 deg and 2 cm, the mean over views.
      expected_error: `(h,)` [rad], the mean over views.
      scores: Of the first, as calibrations weigh them.
    """

    poses: Float[np.ndarray, "h 4 4"]
    extents: Float[np.ndarray, "h 3"]
    log_odds: Float[np.ndarray, "h"]
    expected_error: Float[np.ndarray, "h"]
    scores: Scores


@dataclass(frozen=True)
class MultiViewEstimator:
    """An estimator of one view, asked about several at once.

    Attributes:
      single: Of one view; voting networks with a pose scorer.
    """

    single: PoseEstimator

    @classmethod
    def load(cls, name: str) -> MultiViewEstimator:
        """As `PoseEstimator.load`."""
        return cls(PoseEstimator.load(name))

    def estimate(self, cloud: AnyCloud, *, key: PRNGKeyArray) -> PoseEstimate:
        """As `PoseEstimator.estimate`."""
        return self.single.estimate(cloud, key=key)

    def estimate_views(
        self,
        clouds: Iterable[AnyCloud],
        T_common_camera: Float[np.ndarray, "v 4 4"],
        *,
        key: PRNGKeyArray,
    ) -> PoseEstimate:
        """The pose of an object that several cameras see, in their common frame.

        Args:
          clouds: Of each camera, in its frame; at least one.
          T_common_camera: `(v, 4, 4)`, of each camera [m].
          key: Of all that is drawn.

        Raises:
          InputError: There is no cloud, one cannot be used, or there is not one rigid frame a cloud.
        """
        found = score_together(self.single, clouds, T_common_camera, key=key)
        confidence = _sigmoid(found.log_odds)
        if self.single.calibration is not None:
            confidence = self.single.calibration.of_all(confidence, found.scores)
        symmetry = self.single.trained.model.config.symmetry
        order = distinct_first(found.poses, symmetry)
        first, *others = (
            PoseEstimate(found.poses[i], found.extents[i], float(confidence[i])) for i in order
        )
        return PoseEstimate(first.pose, first.extents, first.confidence, tuple(others))


def score_together(
    estimator: PoseEstimator,
    clouds: Iterable[AnyCloud],
    T_common_camera: Float[np.ndarray, "v 4 4"],
    *,
    key: PRNGKeyArray,
) -> ScoredTogether:
    """Every view's hypotheses, read in all views; arguments and errors are those of `estimate_views`."""
    model = estimator.trained.model
    if not isinstance(model, PoseModel):
        raise InputError("views are scored together by our networks only; estimate each by itself")
    clouds = listed_clouds(clouds)
    frames = checked_frames(T_common_camera, len(clouds))
    seeds_of(key)
    poses, extents, penalty, leads, seen = [], [], [], [], []
    for number, (cloud, frame) in enumerate(zip(clouds, frames, strict=True)):
        own = jax.random.fold_in(key, number)
        try:
            sample = prepared_sample(model, cloud, key=own)
        except InputError as error:
            raise InputError(
                f"cloud {number}: {error}" if len(clouds) > 1 else str(error)
            ) from None
        found, evidence = _estimate_with_evidence(model, *sample, key=own)
        seen.append(evidence)
        poses.append(frame @ np.asarray(found.poses, float))
        extents.append(np.asarray(found.extents))
        assert found.ambiguous is not None  # our networks say which
        penalty.append(_AMBIGUITY * np.asarray(found.ambiguous, float))
        leads.append(np.arange(len(found.poses)) == 0)
    every = np.concatenate(poses)
    logits = np.stack(
        [_scored(model, e, invert(f) @ every) for e, f in zip(seen, frames, strict=True)]
    )
    # Of each view as much as it may say; then the mean, for a rival's lead not to grow with the views.
    logits = np.clip(logits, -_MOST, _MOST)
    log_odds = logits[..., CONFIDENT_LEVEL].mean(axis=0)
    error = np.asarray(expected_rotation_error(jnp.asarray(logits))).mean(axis=0)
    ranked = len(clouds) * log_odds - np.concatenate(penalty)
    symmetry = model.config.symmetry
    best = int(np.argmax(ranked))
    # A view's first has the axis that its own points fit best.
    near = np.concatenate(leads) & alike(every, every[best], symmetry)
    if near.any():
        best = int(np.argmax(np.where(near, ranked, -np.inf)))
    order = np.concatenate([[best], [i for i in np.argsort(-ranked) if i != best]]).astype(int)
    every, log_odds, error = every[order], log_odds[order], error[order]
    scores = scores_of(every, _sigmoid(log_odds), error, symmetry, len(clouds))
    return ScoredTogether(every, np.concatenate(extents)[order], log_odds, error, scores)


def _scored(
    model: PoseModel, seen: Evidence, poses: Float[np.ndarray, "h 4 4"]
) -> Float[np.ndarray, "h levels"]:
    """`score_poses`, so many at once that it is compiled once."""
    found = []
    for start in range(0, len(poses), _AT_ONCE):
        some = poses[start : start + _AT_ONCE].astype(np.float32)
        filled = np.concatenate([some, np.repeat(some[:1], _AT_ONCE - len(some), axis=0)])
        found.append(np.asarray(_score_poses(model, seen, filled))[: len(some)])
    return np.concatenate(found)


def _sigmoid(log_odds: Float[np.ndarray, "h"]) -> Float[np.ndarray, "h"]:
    return 1 / (1 + np.exp(-log_odds))
