"""Whose networks estimate an object of a kind, if nobody else's are asked."""

from __future__ import annotations

from manipose_mj.control.perception.objects.object_kinds import ObjectKind
from manipose_mj.control.perception.pose_sensing import Estimator, EstimatorOfViews


def shipped_estimator(kind: ObjectKind) -> Estimator | EstimatorOfViews:
    """The networks that look through several cameras at once; of kinds outside the catalogue, which they flip more
    often, those of single views.

    Raises:
      InputError: There are no weights for the object type.
    """
    # These load JAX.
    if kind.in_catalogue:
        from manipose_mj.ppf_jax.fused_views import FusedViewEstimator

        return FusedViewEstimator.load(kind.category)
    from manipose_mj.ppf_jax.estimator import PoseEstimator

    return PoseEstimator.load(kind.object_type)
