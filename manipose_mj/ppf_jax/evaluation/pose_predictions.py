"""Running an estimator over a set of clouds."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.label import ObjectType
from manipose_mj.errors import unknown_name
from manipose_mj.poses import invert, transform
from manipose_mj.ppf_jax.data.view_cache import catalogue_subject
from manipose_mj.ppf_jax.estimator import PoseEstimator, bucket
from manipose_mj.ppf_jax.fused_views import FusedViewEstimator
from manipose_mj.ppf_jax.points.clouds import MAX_POINTS, LabelledCloud
from manipose_mj.ppf_jax.pose_estimate import PoseEstimate
from manipose_mj.ppf_jax.two_network_fusion import TwoNetworkFusion

_TIMED, _TIMED_S = (
    20,
    10.0,
)  # objects one by one, at most; seconds after which no further one starts
RIGID_TYPES: tuple[ObjectType, ...] = ("axial", "mirror", "functional")


@dataclass(frozen=True)
class Predictions:
    """What an estimator predicts for `n` clouds.

    Attributes:
      poses: `(n, 4, 4)`, `T_camera_label`.
      confidence: `(n,)`, higher is surer; NaN where a method has none.
      ms_per_object: Median of one object at a time, after compilation, on the machine at hand.
    """

    poses: Float[np.ndarray, "n 4 4"]
    confidence: Float[np.ndarray, "n"]
    ms_per_object: float


def predict(
    estimator: PoseEstimator | TwoNetworkFusion | FusedViewEstimator,
    clouds: Sequence[LabelledCloud],
    *,
    batch: int = 32,
    seed: int = 0,
    timed: int = 20,
) -> Predictions:
    """The likeliest hypothesis for every cloud, as an estimator has them.

    Args:
      estimator: Trained.
      clouds: At least one.
      batch: Clouds at the same time.
      seed: Of what the estimator draws; each cloud's share depends on its place in the list.
      timed: Clouds that are estimated once more, one by one, for the time; NaN if none are.

    Raises:
      InputError: A cloud cannot be used, such as one of several cameras by an estimator of single ones.
    """
    found, batch = [], min(batch, len(clouds))
    for start in range(0, len(clouds), batch):
        some = list(clouds[start : start + batch])
        # The last batch is filled up, so that all have one shape.
        filled = some + [clouds[0]] * (batch - len(some))
        key = jax.random.fold_in(jax.random.key(seed), start)
        found += estimator.estimate_many(filled, key=key)[: len(some)]
    return Predictions(
        np.stack([each.pose for each in found]),
        np.array([each.confidence for each in found]),
        _one_by_one(estimator, clouds[:timed]) if timed else np.nan,
    )


def _one_by_one(
    estimator: PoseEstimator | TwoNetworkFusion | FusedViewEstimator,
    clouds: Sequence[LabelledCloud],
) -> float:
    """Median milliseconds for one object's bare points, from which normals are estimated.

    Of several cameras the cloud is timed as it is: without their places and normals none is one.
    """
    key = jax.random.key(0)

    def estimate(cloud: LabelledCloud) -> PoseEstimate:
        if isinstance(estimator, FusedViewEstimator):
            return estimator.estimate_fused(cloud, key=key)
        return estimator.estimate(cloud.points, key=key)

    fused = isinstance(estimator, FusedViewEstimator)  # all of its clouds have one size
    sizes = {0 if fused else bucket(min(len(cloud), MAX_POINTS)): cloud for cloud in clouds}
    for sized in sizes.values():
        estimate(sized)  # compiles
    spent = []
    for cloud in clouds:
        begin = time.perf_counter()
        estimate(cloud)
        spent.append(time.perf_counter() - begin)
        if sum(spent) > _TIMED_S:
            break
    return 1e3 * float(np.median(spent))


def categories_of(name: str) -> tuple[str, ...]:
    """The rigid categories that a category or a type names.

    Raises:
      InputError: It names neither.
    """
    rigid = {row.name: row.object_type for row in CATALOGUE.values()}
    rigid = {category: kind for category, kind in rigid.items() if kind in RIGID_TYPES}
    if name in RIGID_TYPES:
        return tuple(category for category, kind in rigid.items() if kind == name)
    if name not in rigid:
        raise unknown_name("category or type", name, [*RIGID_TYPES, *rigid])
    return (name,)


def catalogue_hulls(clouds: Sequence[LabelledCloud]) -> Mapping[str, Float[np.ndarray, "h 3"]]:
    """Corners of the convex hulls of the catalogue objects that clouds show, in their label frames."""
    hulls = {}
    for cloud in clouds:
        owner = cloud.name.split("/")[0]
        if owner not in hulls:
            index = int(owner.removeprefix(f"{cloud.category}_"))
            subject = catalogue_subject(cloud.category, index, resting=False)
            hulls[owner] = transform(invert(subject.label.pose), subject.hull)
    return hulls
