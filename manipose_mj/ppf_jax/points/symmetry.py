"""Which of the equivalent labels a vote means, and what all objects of a training have in common.

Votes of a pair: among the equivalent frames the one whose X points most along the pair, then the one
whose Y does. So a box votes for `|cos|` to its axes, a mug for `cos`, a square box for the largest cosine
to its four sides: a function of the pair alone, without a choice that a network would have to guess.
Refinement: the equivalent frame that is nearest to the one that is refined. About an axis of
revolution no Y is asked for.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from manipose_mj.poses import SymmetryGroup, rotation_angle

_HALF_TURNS = np.array(
    [np.diag(signs) for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))], np.float32
)
_Y_AFTER_X = 1e-3  # weight of Y in the choice: decides only between frames of one X


@dataclass(frozen=True)
class CommonSymmetry:
    """What holds for every object that a network is trained on.

    Attributes:
      axial: X is an axis of revolution.
      unsigned_x: Some symmetry maps X onto -X.
      unsigned_y: Some symmetry maps Y onto -Y and leaves X.
      boxes: Not of every object, but of some: all three half turns are symmetries.
    """

    axial: bool = False
    unsigned_x: bool = False
    unsigned_y: bool = False
    boxes: bool = False

    def holds(self, group: SymmetryGroup) -> bool:
        """Whether an object of this group is one for a network of this symmetry, which ignores turns that it has."""
        own = common_symmetry([group])
        requested = (self.axial, self.unsigned_x, self.unsigned_y)
        has = (own.axial, own.unsigned_x, own.unsigned_y)
        return all(b or not a for a, b in zip(requested, has, strict=True))


def common_symmetry(groups: Iterable[SymmetryGroup]) -> CommonSymmetry:
    """What the symmetry groups of a training set share."""
    known = list(groups)
    x, y = np.eye(3)[:2]
    unsigned_x = [_maps(group, np.stack([-x])) for group in known]
    unsigned_y = [_maps(group, np.stack([x, -y])) for group in known]
    boxes = [a and b for a, b in zip(unsigned_x, unsigned_y, strict=True)]
    return CommonSymmetry(
        axial=bool(known) and all(g.axial for g in known),
        unsigned_x=bool(known) and all(unsigned_x),
        unsigned_y=bool(known) and all(unsigned_y),
        boxes=any(boxes) and not all(boxes),
    )


def _maps(group: SymmetryGroup, requested: Float[np.ndarray, "k 3"]) -> bool:
    """Whether a member maps the first axes onto these, up to sign."""
    axes = np.abs(group.rotations[:, :, : len(requested)].swapaxes(1, 2) - requested)
    return bool(np.any(np.all(axes < 1e-3, axis=(1, 2))))


def vote_cosines(
    along: Float[Array, "p 3"],
    rotation: Float[Array, "3 3"],
    symmetry: SymmetryGroup,
) -> Float[Array, "p 2"]:
    """The cosines of each pair to X and Y of the equivalent label that it votes for.

    Args:
      along: Unit directions of the pairs, in the frame that `rotation` maps into.
      rotation: Of the label.
      symmetry: Of the label; an axis of revolution changes nothing here.
    """
    cosines = jnp.einsum("pi,kij->pkj", along, (rotation @ symmetry.rotations)[:, :, :2])
    best = jnp.argmax(cosines[..., 0] + _Y_AFTER_X * cosines[..., 1], axis=1)
    return jnp.take_along_axis(cosines, best[:, None, None], axis=1)[:, 0]


def line_cosines(
    along: Float[Array, "p 3"],
    rotation: Float[Array, "3 3"],
    symmetry: SymmetryGroup,
) -> Float[Array, "p 2"]:
    """The cosines of each pair to the lines of X and Y: `vote_cosines` if either end were X, and Y.

    They can be known where the ends cannot. Arguments as of `vote_cosines`.
    """
    doubled = (symmetry.rotations[:, None] @ jnp.asarray(_HALF_TURNS)).reshape(-1, 3, 3)
    return vote_cosines(along, rotation, SymmetryGroup(doubled))


def nearest_equivalent(
    estimate: Float[Array, "3 3"],
    truth: Float[Array, "3 3"],
    symmetry: SymmetryGroup,
) -> Float[Array, "3 3"]:
    """The rotation equivalent to `truth` that is the least turn away from `estimate`."""
    equivalents = truth @ symmetry.rotations
    spun = jnp.where(symmetry.axial, _spun(estimate, equivalents), equivalents)
    angles = rotation_angle(estimate[None], spun)
    return spun[jnp.argmin(angles)]


def _spun(
    estimate: Float[Array, "3 3"], equivalents: Float[Array, "k 3 3"]
) -> Float[Array, "k 3 3"]:
    """The frames turned about their X so that they are nearest to the estimate."""
    inner = jnp.swapaxes(equivalents, 1, 2) @ estimate
    # Of Rx(t) with the lower right 2x2 block of `inner`, the trace is largest at this t.
    angle = jnp.arctan2(inner[:, 2, 1] - inner[:, 1, 2], inner[:, 1, 1] + inner[:, 2, 2])
    zero, one = jnp.zeros_like(angle), jnp.ones_like(angle)
    c, s = jnp.cos(angle), jnp.sin(angle)
    about_x = jnp.stack([one, zero, zero, zero, c, -s, zero, s, c], axis=-1).reshape(-1, 3, 3)
    return equivalents @ about_x
