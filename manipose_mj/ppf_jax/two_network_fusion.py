"""The pose of an object whose kind is round in the catalogue, but which is not: a flat bottle, an oval can.

The category's network has learnt such objects by their axis: which way is up, and nothing about it. The
network of mirror-symmetric types finds the sides of flat objects, but has never seen a bottle, and lays it down.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import PRNGKeyArray

from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.ppf_jax.estimator import PoseEstimate, PoseEstimator, distinct_first
from manipose_mj.ppf_jax.points.cloud_input import AnyCloud, listed_clouds
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry

AGREED = np.deg2rad(25.0)  # between the axes that the two networks name


@dataclass(frozen=True)
class TwoNetworkFusion:
    """Two networks whose hypotheses are ranked together.

    Attributes:
      upright: Of the category, or of all axial ones: says where up is.
      sides: Of mirror-symmetric objects: says the rest.
    """

    upright: PoseEstimator
    sides: PoseEstimator

    @classmethod
    def load(cls, category: str) -> TwoNetworkFusion:
        """Of a category whose catalogue objects are round, from the weights shipped with the package.

        Raises:
          InputError: No such category, or its objects are not round.
        """
        known = [row.name for row in CATALOGUE.values() if row.object_type == "axial"]
        if category not in CATALOGUE:
            raise unknown_name("axial category", category, known)
        if category not in known:
            raise InputError(
                f"{category} is no axial category; PoseEstimator.load({category!r}) finds its pose"
            )
        return cls(PoseEstimator.load(category), PoseEstimator.load("mirror"))

    def estimate(self, cloud: AnyCloud, *, key: PRNGKeyArray) -> PoseEstimate:
        """As `PoseEstimator.estimate`."""
        return agreed(self.upright.estimate(cloud, key=key), self.sides.estimate(cloud, key=key))

    def estimate_many(self, clouds: Iterable[AnyCloud], *, key: PRNGKeyArray) -> list[PoseEstimate]:
        """As `PoseEstimator.estimate_many`."""
        clouds = listed_clouds(clouds)
        ways = self.upright.estimate_many(clouds, key=key)
        frames = self.sides.estimate_many(clouds, key=key)
        return [agreed(*pair) for pair in zip(ways, frames, strict=True)]


def agreed(upright: PoseEstimate, sides: PoseEstimate) -> PoseEstimate:
    """The likeliest frame whose X is where the other network has it, and that is longer along Y than along Z.

    A round object made flat has its Y along the longer horizontal length, as labels of two planes have. Where
    no frame is as wanted, X counts more than lengths. Confidences are those of `sides`.
    """
    axis = upright.pose[:3, 0]

    def rank(each: PoseEstimate) -> tuple[bool, bool, float]:
        up = bool(each.pose[:3, 0] @ axis > np.cos(AGREED))
        return up, bool(each.extents[1] >= each.extents[2]), each.confidence

    ranked = sorted((sides, *sides.hypotheses), key=rank, reverse=True)
    order = distinct_first(np.stack([each.pose for each in ranked]), CommonSymmetry())
    first, *others = (
        PoseEstimate(ranked[i].pose, ranked[i].extents, ranked[i].confidence) for i in order
    )
    return PoseEstimate(first.pose, first.extents, first.confidence, tuple(others))
