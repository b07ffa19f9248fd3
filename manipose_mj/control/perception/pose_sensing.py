"""Where an object is, from what several cameras see of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from jaxtyping import Float

from manipose_mj.control.perception.objects.known_shapes import KnownShape
from manipose_mj.control.perception.objects.object_views import ObjectView, seen_points
from manipose_mj.control.perception.objects.shape_fits import ShapeFitter
from manipose_mj.poses import invert, rotation_angle, transform

if TYPE_CHECKING:
    from manipose_mj.ppf_jax.pose_estimate import PoseEstimate

MIN_VIEW_POINTS = 32
_LEAST_CONFIDENCE = 0.05  # of a hypothesis that is looked at beside each camera's first
_SAME = (0.003, np.deg2rad(3.0))  # hypotheses this near to one another are one [m, rad]
_DISTRUST = 0.5  # how much more misfit counts of what the estimator does not trust at all


class Estimator(Protocol):
    """Such as `manipose_mj.ppf_jax.estimator.PoseEstimator`."""

    def estimate(self, cloud: Any, *, key: Any) -> PoseEstimate:
        """The pose of the object that a cloud shows."""
        ...


@dataclass(frozen=True)
class SensedPose:
    """Attributes:
    pose: `T_world_label`.
    shape: What the object looks like, in the label's frame.
    misfit: Mean distance of the points seen from that shape there [m].
    confidence: The estimator's, of being within 15 deg and 2 cm.
    camera: Whose cloud led to it.
    """

    pose: Float[np.ndarray, "4 4"]
    shape: KnownShape
    misfit: float
    confidence: float
    camera: str


def sense_pose(
    estimator: Estimator,
    views: Sequence[ObjectView],
    shapes: ShapeFitter,
    keys: Callable[[], Any],
) -> SensedPose | None:
    """The likeliest of all cameras' hypotheses: the one whose shape is nearest to all that is seen.

    Each camera's cloud is estimated by itself, for the estimator looks from one point. Hypotheses are
    then held against the points of all.

    Args:
      estimator: Of the object's kind.
      views: At least one point each.
      shapes: Find the shape that goes with each hypothesis.
      keys: A new random key at every call.

    Returns:
      None where no camera sees enough.
    """
    views = [view for view in views if len(view) >= MIN_VIEW_POINTS]
    if not views:
        return None
    points = seen_points(views)
    best, least = None, np.inf
    for view in views:
        estimate = estimator.estimate(view, key=keys())
        for hypothesis in _different([estimate, *estimate.hypotheses]):
            pose = view.T_world_camera @ hypothesis.pose.astype(float)
            found = shapes.fit(hypothesis, pose, views)
            score = weighed(found.contradiction, hypothesis.confidence)
            if score < least:
                least, best = score, (pose, found, hypothesis.confidence, view.camera)
    if best is None:
        return None
    pose, found, confidence, camera = best
    shape = found.shape()
    misfit = shape.misfit(transform(invert(pose), points))
    return SensedPose(pose, shape, misfit, confidence, camera)


def weighed(misfit: float, confidence: float) -> float:
    """How badly a pose fits [m], by its misfit [m] and by how far the estimator trusts it; less is better."""
    return misfit * (1 + _DISTRUST * (1 - confidence))


def _different(hypotheses: Sequence[PoseEstimate]) -> list[PoseEstimate]:
    """The first, and those of some confidence that differ from the ones before."""
    kept: list[PoseEstimate] = []
    for one in hypotheses:
        if kept and one.confidence < _LEAST_CONFIDENCE:
            continue
        if not any(_alike(one.pose, other.pose) for other in kept):
            kept.append(one)
    return kept


def _alike(one: Float[np.ndarray, "4 4"], other: Float[np.ndarray, "4 4"]) -> bool:
    shift = float(np.linalg.norm(one[:3, 3] - other[:3, 3]))
    return shift < _SAME[0] and float(rotation_angle(one[:3, :3], other[:3, :3])) < _SAME[1]
