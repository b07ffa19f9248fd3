"""Objects of a category that is round in the catalogue, but which are not: a flat bottle, an oval can.

The category's network finds their axis and nothing about it. Where no round shape fits what is seen, two networks
together look once more, and a flattened shape that fits better is taken instead.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from manipose_mj.control.perception.known_shapes import KnownShape, best_fit, known_shapes
from manipose_mj.control.perception.object_kinds import ObjectKind
from manipose_mj.control.perception.object_views import ObjectView, seen_points
from manipose_mj.control.perception.pose_sensing import SensedPose, sense_pose
from manipose_mj.control.perception.shapes.completed_shape import in_front
from manipose_mj.control.perception.shapes.estimated_symmetry import estimated_symmetry
from manipose_mj.control.perception.shapes.shape_fits import ShapeFit
from manipose_mj.poses import SymmetryGroup, invert, transform

if TYPE_CHECKING:
    from manipose_mj.ppf_jax.pose_estimate import PoseEstimate

# Round test objects have misfits of 2.0 to 4.0 mm (a bin 6.0), and flattened shapes fit them 0.95 to 2.5 times as badly;
# flat bottles and cans have 5.9 to 8.0 mm, and 0.54 to 0.89 times of it when flattened.
_ROUND = 0.0045  # misfit up to which what is seen is round [m]
_BETTER = 0.92  # of that misfit, for something flat to be believed
_HALF_TURN = SymmetryGroup(np.stack([np.eye(3), np.diag([1.0, -1.0, -1.0])]))


@dataclass(frozen=True)
class FlatShapes:
    """The training object of a round category that fits best, stretched to three different lengths."""

    shapes: Sequence[KnownShape]

    def fit(
        self,
        hypothesis: PoseEstimate,
        pose: Float[np.ndarray, "4 4"],
        views: Sequence[ObjectView],
    ) -> ShapeFit:
        """As `ShapeFitter.fit`."""
        local = transform(invert(pose), seen_points(views))
        extents = np.maximum(hypothesis.extents.astype(float), 1e-3)
        shape, misfit = best_fit(self.shapes, extents, local)

        def alike_turned() -> KnownShape:
            group = estimated_symmetry(
                "mirror",
                local,
                shape.surface,
                shape.label.center,
                lambda moved: in_front(transform(pose, moved), views),
            )
            turned = any(np.allclose(turn, _HALF_TURN.rotations[1]) for turn in group.rotations)
            symmetry = _HALF_TURN if turned else SymmetryGroup.identity()
            return replace(shape, label=replace(shape.label, symmetry=symmetry))

        return ShapeFit(misfit, alike_turned)


def sensed_if_flat(
    kind: ObjectKind, sensed: SensedPose, views: Sequence[ObjectView], keys: Callable[[], Any]
) -> SensedPose:
    """`sensed`, or the pose of something flat where that fits what is seen much better.

    Args:
      kind: Of the object; only round ones of the catalogue are looked at again.
      sensed: By the category's network, as something round.
      views: That it was sensed in.
      keys: A new random key at every call.
    """
    if not (kind.in_catalogue and kind.object_type == "axial") or sensed.misfit <= _ROUND:
        return sensed
    from manipose_mj.ppf_jax.two_network_fusion import TwoNetworkFusion  # loads JAX

    fusion = TwoNetworkFusion.load(kind.category)
    shapes = [_flat(shape) for shape in known_shapes(kind.category)]
    flat = sense_pose(fusion, views, FlatShapes(shapes), keys)
    if flat is None or flat.misfit > _BETTER * sensed.misfit:
        return sensed
    return flat


def _flat(shape: KnownShape) -> KnownShape:
    """A round shape as one that is not round."""
    return replace(shape, label=replace(shape.label, object_type="mirror", symmetry=_HALF_TURN))
