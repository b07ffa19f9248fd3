"""What an object looks like if a hypothesis about its pose is right: how it is found out for each kind of object."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.label import ObjectType
from manipose_mj.control.perception.objects.completed_shape import (
    completed_shape,
    in_company,
    looked_through,
)
from manipose_mj.control.perception.objects.known_shapes import (
    KnownShape,
    best_fit,
    known_shapes,
    nearest_shape,
)
from manipose_mj.control.perception.objects.object_kinds import ObjectKind
from manipose_mj.control.perception.objects.object_views import ObjectView, seen_points
from manipose_mj.poses import invert, transform

if TYPE_CHECKING:
    from manipose_mj.ppf_jax.pose_estimate import PoseEstimate

_NOISE = 0.002  # [m], of points that nothing contradicts: what confidence is weighed against


@dataclass(frozen=True)
class ShapeFit:
    """Attributes:
    contradiction: How badly the hypothesis fits all that is seen [m]; the least wins.
    shape: What the object looks like then, in the label's frame; made when it is asked for.
    """

    contradiction: float
    shape: Callable[[], KnownShape]


class ShapeFitter(Protocol):
    """Finds the shape that goes with a hypothesis."""

    def fit(
        self,
        hypothesis: PoseEstimate,
        pose: Float[np.ndarray, "4 4"],
        views: Sequence[ObjectView],
    ) -> ShapeFit:
        """The shape, and how it fits.

        Args:
          hypothesis: Whose extents count, if it has any.
          pose: `T_world_label` by it.
          views: All that is seen.
        """
        ...


@dataclass(frozen=True)
class KnownShapes:
    """The training object of a category that fits best, stretched to the hypothesis."""

    shapes: Sequence[KnownShape]

    def fit(
        self,
        hypothesis: PoseEstimate,
        pose: Float[np.ndarray, "4 4"],
        views: Sequence[ObjectView],
    ) -> ShapeFit:
        """As `ShapeFitter.fit`."""
        local = transform(invert(pose), seen_points(views))
        if np.isnan(hypothesis.extents).any():  # nobody said: some known object as it is
            shape, misfit = nearest_shape(self.shapes, local)
        else:
            extents = _lengths(hypothesis, self.shapes[0])
            shape, misfit = best_fit(self.shapes, extents, local)
        return ShapeFit(misfit, lambda: shape)


@dataclass(frozen=True)
class OneShape:
    """A shape that was found before, as it is."""

    shape: KnownShape

    def fit(
        self,
        hypothesis: PoseEstimate,
        pose: Float[np.ndarray, "4 4"],
        views: Sequence[ObjectView],
    ) -> ShapeFit:
        """As `ShapeFitter.fit`."""
        misfit = self.shape.misfit(transform(invert(pose), seen_points(views)))
        return ShapeFit(misfit, lambda: self.shape)


@dataclass(frozen=True)
class CompletedShapes:
    """The cloud itself, completed by the symmetry of the object's type: of a category that nobody knows shapes of."""

    category: str
    object_type: ObjectType

    def fit(
        self,
        hypothesis: PoseEstimate,
        pose: Float[np.ndarray, "4 4"],
        views: Sequence[ObjectView],
    ) -> ShapeFit:
        """As `ShapeFitter.fit`."""
        points = seen_points(views)
        contradiction = looked_through(self.object_type, pose, points[in_company(points)], views)
        return ShapeFit(
            _NOISE + contradiction,
            lambda: completed_shape(self.category, self.object_type, pose, views),
        )


def shapes_of(kind: ObjectKind) -> ShapeFitter:
    """What finds the shapes of objects of a kind."""
    if kind.in_catalogue:
        return KnownShapes(known_shapes(kind.category))
    return CompletedShapes(kind.category, kind.object_type)


def _lengths(hypothesis: PoseEstimate, shape: KnownShape) -> Float[np.ndarray, "3"]:
    """The estimated extents [m]; what is round stays so."""
    extents = np.maximum(hypothesis.extents.astype(float), 1e-3)
    if shape.label.symmetry.axial:
        extents[1:] = extents[1:].mean()
    return extents
