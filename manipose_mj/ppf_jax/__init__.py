"""Pose estimation from partial clouds by point-pair features and voting, in JAX.

`PoseEstimator` finds rigid objects, `MultiViewEstimator` and `FusedViewEstimator` those that several cameras see,
`ArticulatedEstimator` the handles and joints of furniture, and `TwoNetworkFusion` flat objects of round categories.
`Cloud` is what they take where points have normals. Importing this package loads none of them, and no JAX, before the
first one is used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from manipose_mj.ppf_jax.articulated_estimator import ArticulatedEstimator, PartEstimate
    from manipose_mj.ppf_jax.estimator import PoseEstimator
    from manipose_mj.ppf_jax.fused_views import FusedViewEstimator
    from manipose_mj.ppf_jax.multi_view import MultiViewEstimator
    from manipose_mj.ppf_jax.points.cloud_input import Cloud
    from manipose_mj.ppf_jax.points.clouds import LabelledCloud
    from manipose_mj.ppf_jax.pose_estimate import PoseEstimate
    from manipose_mj.ppf_jax.two_network_fusion import TwoNetworkFusion

__all__ = [
    "ArticulatedEstimator",
    "Cloud",
    "FusedViewEstimator",
    "LabelledCloud",
    "MultiViewEstimator",
    "PartEstimate",
    "PoseEstimate",
    "PoseEstimator",
    "TwoNetworkFusion",
]

__getattr__ = lazy_exports(__name__, __file__)
