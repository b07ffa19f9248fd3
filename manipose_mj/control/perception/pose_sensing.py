"""Where an object is, from what several cameras see of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from manipose_mj.control.perception.objects.known_shapes import KnownShape
from manipose_mj.control.perception.objects.object_views import ObjectView, seen_points
from manipose_mj.control.perception.objects.shape_fits import ShapeFit, ShapeFitter
from manipose_mj.poses import invert, pose_error, rotation_angle, transform

if TYPE_CHECKING:
    from manipose_mj.ppf_jax.pose_estimate import PoseEstimate

MIN_VIEW_POINTS = 32
_MIN_SHARE = 8  # points of a camera that counts among others
_LEAST_CONFIDENCE = 0.05  # of a hypothesis that is looked at beside each camera's first
_SAME = (0.003, np.deg2rad(3.0))  # hypotheses this near to one another are one [m, rad]
_DISTRUST = 0.5  # how much more misfit counts of what the estimator does not trust at all


class Estimator(Protocol):
    """Such as `manipose_mj.ppf_jax.estimator.PoseEstimator`."""

    def estimate(self, cloud: Any, *, key: Any) -> PoseEstimate:
        """The pose of the object that a cloud shows."""
        ...


@runtime_checkable
class EstimatorOfViews(Protocol):
    """Such as `manipose_mj.ppf_jax.fused_views.FusedViewEstimator`."""

    def estimate_views(
        self, clouds: Sequence[Any], T_common_camera: Float[np.ndarray, "v 4 4"], *, key: Any
    ) -> PoseEstimate:
        """The pose of the object that several clouds show, in the cameras' common frame."""
        ...


@dataclass(frozen=True)
class SensedPose:
    """Attributes:
    pose: `T_world_label`.
    shape: What the object looks like, in the label's frame.
    misfit: Mean distance of the points seen from that shape there [m].
    confidence: The estimator's, of being within 15 deg and 2 cm.
    camera: Whose cloud led to it; all of them, as in `front+left`, where they were estimated as one.
    points: How many its shape was found by.
    """

    pose: Float[np.ndarray, "4 4"]
    shape: KnownShape
    misfit: float
    confidence: float
    camera: str
    points: int = 0

    def reported(self, name: str) -> EstimatedPose:
        """What reports have of it, where it is this object's."""
        return EstimatedPose(name, self.pose, self.confidence, self.camera)


@dataclass(frozen=True)
class EstimatedPose:
    """The pose of an object at the last observation, for reports.

    Attributes: name; pose `T_world_label`; confidence: when it was estimated; camera: that saw it.
    """

    name: str
    pose: Float[np.ndarray, "4 4"]
    confidence: float
    camera: str


def sense_pose(
    estimator: Estimator | EstimatorOfViews,
    views: Sequence[ObjectView],
    shapes: ShapeFitter,
    keys: Callable[[], Any],
) -> SensedPose | None:
    """The likeliest pose, and the shape that is nearest to all that is seen then.

    An estimator of several views is asked once. Others look from one point: each camera's cloud is estimated by
    itself, and the hypotheses are held against the points of all.

    Args:
      estimator: Of the object's kind.
      views: At least one point each.
      shapes: Find the shape that goes with each hypothesis.
      keys: A new random key at every call.

    Returns:
      None where no camera sees enough.
    """
    if isinstance(estimator, EstimatorOfViews):
        return _sensed_together(estimator, views, shapes, keys)
    views = [view for view in views if len(view) >= MIN_VIEW_POINTS]
    if not views:
        return None
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
    return _with_shape(*best, views)


def _sensed_together(
    estimator: EstimatorOfViews,
    views: Sequence[ObjectView],
    shapes: ShapeFitter,
    keys: Callable[[], Any],
) -> SensedPose | None:
    """The likeliest pose by one cloud of all views; which of its hypotheses it is, shapes do not tell better."""
    views = [view for view in views if len(view) >= _MIN_SHARE]
    if sum(len(view) for view in views) < MIN_VIEW_POINTS:
        return None
    frames = np.stack([view.T_world_camera for view in views])
    found = estimator.estimate_views(views, frames, key=keys())
    fit = shapes.fit(found, found.pose, views)
    cameras = "+".join(view.camera for view in views)
    return _with_shape(found.pose, fit, found.confidence, cameras, views)


def _with_shape(
    pose: Float[np.ndarray, "4 4"],
    fit: ShapeFit,
    confidence: float,
    camera: str,
    views: Sequence[ObjectView],
) -> SensedPose:
    shape = fit.shape()
    points = seen_points(views)
    misfit = shape.misfit(transform(invert(pose), points))
    return SensedPose(pose, shape, misfit, confidence, camera, len(points))


def agree(one: SensedPose, other: SensedPose, within: tuple[float, float]) -> bool:
    """Whether two poses of an object differ by less than this [m, rad]; the other's shape has its symmetry."""
    shift, turn = pose_error(one.pose, other.pose, other.shape.label.symmetry)
    return bool(shift < within[0] and turn < within[1])


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


def random_keys(seed: int) -> Callable[[], Any]:
    """A new random key at every call, always the same ones for a seed."""
    count = 0

    def next_key() -> Any:
        import jax

        nonlocal count
        count += 1
        return jax.random.fold_in(jax.random.key(seed), count)

    return next_key
