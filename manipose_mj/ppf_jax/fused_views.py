"""One object seen by several calibrated cameras, voted for by what all of them see: one cloud, one estimate.

Networks that look from one point learn what is hidden from it, and are wrong about clouds of several. These have learnt
such clouds, each point with the place of the camera that saw it. `MultiViewEstimator` asks networks of one view instead.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Float, PRNGKeyArray

from manipose_mj.errors import InputError
from manipose_mj.poses import invert, transform
from manipose_mj.ppf_jax.confidence import Scores
from manipose_mj.ppf_jax.estimator import (
    LONGEST,
    MIN_POINTS,
    SHORTEST,
    PoseEstimator,
    filled,
    scores_found,
)
from manipose_mj.ppf_jax.points.camera_frames import checked_frames
from manipose_mj.ppf_jax.points.cloud_input import (
    AnyCloud,
    checked_cloud,
    cloud_arrays,
    distinct_rows,
    listed_clouds,
    seeds_of,
)
from manipose_mj.ppf_jax.points.cloud_normals import cloud_normals
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.ppf_jax.pose_estimate import PoseEstimate
from manipose_mj.ppf_jax.rigid.model import Estimates, PoseModel, estimate_sample

VIEW_POINTS = 256  # of each camera, at most: as in training
MIN_VIEW_POINTS = 8  # of a camera that counts: fewer have no normals worth the name

_estimate_sample = jax.jit(estimate_sample)


@dataclass(frozen=True)
class FusedCloud:
    """What several cameras see, in the frame of the one that sees most.

    Attributes:
      points: `(n, 3)` float32 [m].
      normals: `(n, 3)` float32, unit, towards the camera that saw the point.
      eyes: `(n, 3)` float32 [m], where that camera is.
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    eyes: Float[np.ndarray, "n 3"]


@dataclass(frozen=True)
class FusedViewEstimator:
    """An estimator of what several cameras see.

    Attributes:
      networks: Trained on clouds of several cameras.
    """

    networks: PoseEstimator

    @classmethod
    def load(cls, name: str) -> FusedViewEstimator:
        """The estimator of a category or of an object type, by the networks of its type.

        Raises:
          InputError: No such category or type.
        """
        return cls(PoseEstimator.load(name, cameras="several"))

    def estimate(self, cloud: AnyCloud, *, key: PRNGKeyArray) -> PoseEstimate:
        """The pose in the frame of one camera, by what that sees alone.

        Raises:
          InputError: The cloud cannot be used.
        """
        return self.estimate_views([cloud], np.eye(4)[None], key=key)

    def estimate_views(
        self,
        clouds: Iterable[AnyCloud],
        T_common_camera: Float[np.ndarray, "v 4 4"],
        *,
        key: PRNGKeyArray,
    ) -> PoseEstimate:
        """The pose of the object that all cameras see, in their common frame.

        Args:
          clouds: Of each camera, in its frame; those of fewer than `MIN_VIEW_POINTS` points do not count.
          T_common_camera: `(v, 4, 4)`, of each camera [m].
          key: Of all that is drawn.

        Raises:
          InputError: There is not one frame a cloud, a cloud cannot be used, all see too little together, or the
            networks have learnt from single cameras.
        """
        rng = np.random.default_rng(seeds_of(key))
        cloud, T_common_camera = fused_cloud(clouds, T_common_camera, rng=rng)
        found = self.estimate_fused(cloud, key=key)
        others = tuple(_moved(each, T_common_camera) for each in found.hypotheses)
        return replace(_moved(found, T_common_camera), hypotheses=others)

    def estimate_many(
        self, clouds: Iterable[FusedCloud | LabelledCloud], *, key: PRNGKeyArray
    ) -> list[PoseEstimate]:
        """`estimate_fused` of each; errors as there."""
        seeds_of(key)
        clouds = listed_clouds(clouds)
        keys = jax.random.split(key, len(clouds)) if clouds else ()
        return [
            self.estimate_fused(cloud, key=own) for cloud, own in zip(clouds, keys, strict=True)
        ]

    def estimate_fused(
        self, cloud: FusedCloud | LabelledCloud, *, key: PRNGKeyArray
    ) -> PoseEstimate:
        """The pose of the object that a cloud of several cameras shows, in its frame.

        Raises:
          InputError: The networks have learnt from single cameras, or the cloud cannot be used.
        """
        return self.networks.as_estimate(self._found(cloud, key=key))

    def scores(
        self, cloud: FusedCloud | LabelledCloud, *, key: PRNGKeyArray
    ) -> tuple[Float[np.ndarray, "4 4"], Scores]:
        """The pose that `estimate_fused` finds, and what its confidence is made of; errors as there."""
        found = self._found(cloud, key=key)
        return scores_found(self.networks, found)

    def _found(self, cloud: FusedCloud | LabelledCloud, *, key: PRNGKeyArray) -> Estimates:
        model = self.networks.trained.model
        if not isinstance(model, PoseModel) or self.networks.trained.cameras != "several":
            raise InputError(
                "networks that have learnt from one camera; expected such as "
                "PoseEstimator.load(name, cameras='several')"
            )
        rng = np.random.default_rng(seeds_of(key))
        checked = _checked(cloud)
        rows = rng.permutation(len(checked.points))[: model.config.sample]
        points, mask = filled(checked.points[rows], model.config.sample)
        eyes, _ = filled(checked.eyes[rows], model.config.sample)
        first = rows[: model.config.points]
        normals, _ = filled(checked.normals[first], model.config.points)
        return _estimate_sample(model, points, normals, mask, key=key, eyes=eyes)


def fused_cloud(
    clouds: Iterable[AnyCloud],
    T_common_camera: Float[np.ndarray, "v 4 4"],
    *,
    rng: np.random.Generator,
) -> tuple[FusedCloud, Float[np.ndarray, "4 4"]]:
    """What all cameras see as one cloud; arguments and errors are those of `estimate_views`.

    Args:
      clouds: Of each camera.
      T_common_camera: Of each.
      rng: Draws `VIEW_POINTS` of the points of a camera that sees more.

    Returns:
      The cloud, and its frame in the common one.
    """
    clouds = listed_clouds(clouds)
    frames = checked_frames(T_common_camera, len(clouds))
    seen = []
    for number, (cloud, frame) in enumerate(zip(clouds, frames, strict=True)):
        try:
            if distinct_rows(cloud_arrays(cloud)[0]).sum() < MIN_VIEW_POINTS:
                continue
            points, normals = checked_cloud(
                cloud, fewest=MIN_VIEW_POINTS, shortest=0.0, longest=LONGEST, what="an object"
            )
        except InputError as error:
            raise InputError(
                f"cloud {number}: {error}" if len(clouds) > 1 else str(error)
            ) from None
        kept = rng.permutation(len(points))[:VIEW_POINTS]
        normals = cloud_normals(points, kept) if normals is None else normals[kept]
        seen.append((points[kept], _towards(points[kept], normals), frame))
    if not seen:
        raise InputError(f"{len(clouds)} clouds, none of {MIN_VIEW_POINTS} points; expected one")
    main = max(seen, key=lambda each: len(each[0]))[2]
    points, normals, eyes = [], [], []
    for own, towards, frame in seen:
        across = np.eye(4) if frame is main else invert(main) @ frame
        points.append(transform(across, own.astype(float)))
        normals.append(towards @ across[:3, :3].T)
        eyes.append(np.broadcast_to(across[:3, 3], own.shape))
    rows = [np.concatenate(each).astype(np.float32) for each in (points, normals, eyes)]
    checked_cloud(rows[0], fewest=MIN_POINTS, shortest=SHORTEST, longest=LONGEST, what="an object")
    return FusedCloud(*rows), main


def _checked(cloud: FusedCloud | LabelledCloud) -> FusedCloud:
    """The cloud with each point once, and where the camera that saw it is, also if that is the origin."""
    points, normals = checked_cloud(
        cloud, fewest=MIN_POINTS, shortest=SHORTEST, longest=LONGEST, what="an object"
    )
    if normals is None or not hasattr(cloud, "eyes"):
        raise InputError(
            "a fused cloud without normals or eyes; expected a FusedCloud(points, normals, eyes), or the cloud of "
            "each camera with estimate_views"
        )
    if cloud.eyes is None:
        return FusedCloud(points, normals, np.zeros_like(points))
    given, eyes = np.asarray(cloud.points), np.asarray(cloud.eyes)
    if eyes.shape != given.shape or eyes.dtype.kind not in "fiu" or not np.isfinite(eyes).all():
        raise InputError(
            f"eyes of shape {eyes.shape} and type {eyes.dtype} with points of shape {given.shape}; expected as many, finite"
        )
    return FusedCloud(points, normals, eyes[distinct_rows(given)])


def _towards(
    points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """Unit normals towards the camera, at the origin."""
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    away = np.sum(normals * points, axis=1, keepdims=True) > 0
    return np.where(away, -normals, normals)


def _moved(estimate: PoseEstimate, T_common_camera: Float[np.ndarray, "4 4"]) -> PoseEstimate:
    return replace(estimate, pose=T_common_camera @ estimate.pose.astype(float), hypotheses=())
