"""What training asks of one labelled cloud of furniture: honest votes for the body, and for each part."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.articulated.body_frame import (
    BODY_IN_LABEL,
    BODY_TURNS,
    CANDIDATES,
    aligned,
    candidates,
)
from manipose_mj.ppf_jax.articulated.model import ArticulatedModel, body_cloud, body_votes
from manipose_mj.ppf_jax.articulated.part_network import (
    LENGTH,
    SLIDE_LENGTH,
    TURN,
    BodyCloud,
    PointVotes,
)
from manipose_mj.ppf_jax.articulated.part_voting import unit
from manipose_mj.ppf_jax.data.articulated.clouds import FurnitureBatch
from manipose_mj.ppf_jax.points.rotations import from_vector, to_vector
from manipose_mj.ppf_jax.points.symmetry import vote_cosines
from manipose_mj.ppf_jax.rigid.features import normalised
from manipose_mj.ppf_jax.rigid.network import PairVotes

# Of a handle's two directions, the vote is for the one with this scalar product above zero; half a
# turn of the body turns it as well. As labels have it: up, or for a level handle, with Z up.
_RULE = np.array([0.0, 1.0, 0.5], np.float32)
_NEAR = 0.25  # error of a frame that part votes can be asked for in [rad]
_HANDLE_WEIGHT = 3.0  # of handle points in the classes' loss


@dataclass(frozen=True)
class ArticulatedLoss:
    """How clouds are varied, and how many pairs vote.

    Attributes:
      pairs: Votes for the body's frame.
      stretch: Logarithm of the largest factor by which furniture is enlarged or shrunk.
      turn: Largest error of the body's frame before it is aligned, drawn evenly up to it [rad].
      unaligned: Share of the clouds whose frame is left as it is drawn.
      rolled: Share of the clouds whose frame is a quarter turn off about the front.
      wrong_front: Share of those whose frame may have another side for the front and be far off, as where an
        open door is taken for the front: of those that are, only the pose scorer learns.
      far: Largest error of such a frame before it is aligned [rad].
    """

    pairs: int = 1000
    stretch: float = 0.25
    turn: float = float(np.radians(9.0))
    unaligned: float = 0.3
    rolled: float = 0.1
    wrong_front: float = 0.3
    far: float = 0.8

    def __call__(
        self, model: ArticulatedModel, sample: FurnitureBatch, *, key: PRNGKeyArray
    ) -> tuple[Float[Array, ""], dict[str, Float[Array, ""]]]:
        """The loss of one row of a batch, and its parts."""
        body_key, frame_key = jax.random.split(key)
        parts = body_losses(model, sample, self.pairs, key=body_key)
        cloud, targets, known = varied(sample, self, key=frame_key)
        parts |= part_losses(model.parts(cloud), targets, known, cloud.mask)
        return sum(parts.values(), start=jnp.zeros(())), parts


def body_losses(
    model: ArticulatedModel, sample: FurnitureBatch, pairs: int, *, key: PRNGKeyArray
) -> dict[str, Float[Array, ""]]:
    """Laplace's negative log likelihood of the votes for the body's origin and axes."""
    count = model.config.body_points
    cloud = normalised(sample.points[:count], sample.normals[:count], sample.mask[:count])
    votes: PairVotes = body_votes(model, cloud, pairs, key=key)
    rotation = sample.body[:3, :3] @ BODY_IN_LABEL
    offset = (sample.body[:3, 3] - cloud.centre) / cloud.scale - votes.start
    mu = jnp.sum(offset * votes.along, axis=-1)
    nu = jnp.sqrt(jnp.maximum(jnp.sum(offset**2, axis=-1) - mu**2, 1e-10))
    cosines = vote_cosines(votes.along, rotation, SymmetryGroup(jnp.asarray(BODY_TURNS)))
    truth = jnp.concatenate([mu[:, None], nu[:, None], cosines], axis=-1)
    losses = jnp.abs(votes.values - truth) * jnp.exp(-votes.log_scale) + votes.log_scale
    mean = jnp.mean(losses, axis=0)
    return {"body_origin": mean[0] + mean[1], "body_front": mean[2], "body_up": mean[3]}


def varied(
    sample: FurnitureBatch, config: ArticulatedLoss, *, key: PRNGKeyArray
) -> tuple[BodyCloud, dict[str, Float[Array, "n k"]], dict[str, Array]]:
    """The cloud in a frame of the body such as might be estimated, its mirror image, or enlarged.

    Returns:
      The cloud; what each point should vote for, by the names of `VOTES`; and `classes (n,)` int,
      `moving (n,)` and `hinge (n,)` bool, whether the frame is `sound` enough to vote in and `right`.
    """
    keys = jax.random.split(key, 8)
    rotation = sample.body[:3, :3] @ BODY_IN_LABEL
    half = jnp.where(
        jax.random.bernoulli(keys[0]), jnp.diag(jnp.array([1.0, -1.0, -1.0])), jnp.eye(3)
    )
    share = jax.random.uniform(keys[1])
    wrong_front = share > 1 - config.wrong_front
    other = jax.random.randint(keys[7], (), 0, CANDIDATES)
    which = jnp.where(wrong_front, other, jnp.where(share < config.rolled, 1, 0))
    towards = -unit(jnp.sum(sample.points, axis=0))
    turn = jax.random.normal(keys[2], (3,))
    most = jnp.where(wrong_front, config.far, config.turn)
    turn = turn / jnp.linalg.norm(turn) * most * jax.random.uniform(keys[3])
    right = candidates(rotation, towards)[which] @ half
    frame = right @ from_vector(turn)
    refined, _ = aligned(frame, sample.points, sample.normals, sample.mask)
    frame = jnp.where(jax.random.bernoulli(keys[6], config.unaligned), frame, refined)
    off = to_vector(jnp.swapaxes(frame, 0, 1) @ right)
    # Where even the right front faces away from the camera, another stands for it.
    near = (jnp.linalg.norm(off) < _NEAR) & (right[:, 0] @ rotation[:, 0] > 0.9)
    cloud, centre = body_cloud(sample.points, sample.normals, sample.mask, frame)
    sign = jnp.where(jax.random.bernoulli(keys[4]), 1.0, -1.0)
    mirror = jnp.stack([jnp.ones(()), jnp.ones(()), sign])
    size = jnp.exp(config.stretch * jax.random.uniform(keys[5], minval=-1.0))
    cloud = BodyCloud(
        cloud.points * mirror * size, cloud.normals * mirror, cloud.views * mirror, cloud.mask
    )
    part = jnp.maximum(sample.part, 0)
    centres = (sample.handles[:, :3, 3] - centre) @ frame * mirror * size
    x = sample.handles[:, :3, 0] @ frame * mirror
    shut = sample.shut_x @ frame * mirror
    x = x * jnp.where(shut @ _RULE < 0, -1.0, 1.0)[:, None]
    y = sample.handles[:, :3, 1] @ frame * mirror
    # The direction of a hinge is a turning sense: a mirror keeps what lies in it and turns round the rest.
    axis = sample.axis @ frame * mirror
    axis = axis * jnp.where(sample.hinge, sign, 1.0)[:, None]
    line = ((sample.axis_origin - centre) @ frame * mirror * size)[part]
    along = axis[part]
    to_line = line - cloud.points
    to_line = to_line - jnp.sum(to_line * along, axis=-1, keepdims=True) * along
    opening = jnp.where(sample.hinge, sample.opening, sample.opening * size / SLIDE_LENGTH)
    targets = {
        "centre": (centres[part] - cloud.points) / LENGTH,
        "x": x[part],
        "y": y[part],
        "axis": along,
        "line": to_line / LENGTH,
        "opening": opening[part][:, None],
        # A turning sense, too.
        "turn": jnp.broadcast_to(off * mirror * sign / TURN, cloud.points.shape),
    }
    moving = sample.part >= 0
    classes = jnp.where(moving, 1 + sample.handle, 0)
    known = {"classes": classes, "moving": moving, "hinge": sample.hinge[part]}
    # A frame that is rolled about the front is still good enough to vote in.
    known |= {"sound": near, "right": near & (which != 1)}
    return cloud, targets, known


def part_losses(
    votes: PointVotes,
    targets: dict[str, Float[Array, "n k"]],
    known: dict[str, Array],
    mask: Bool[Array, "n"],
) -> dict[str, Float[Array, ""]]:
    """Cross entropy of classes and joint types; Laplace's likelihood of the votes of moving points."""
    moving = known["moving"] & mask
    count = jnp.maximum(jnp.sum(moving), 1)
    log_class = jax.nn.log_softmax(votes.logits)
    wrong = -jnp.take_along_axis(log_class, known["classes"][:, None], axis=-1)[:, 0]
    weight = mask * jnp.where(known["classes"] == 2, _HANDLE_WEIGHT, 1.0)
    losses = {"classes": 3 * jnp.sum(weight * wrong) / jnp.maximum(jnp.sum(weight), 1)}
    type_loss = jax.nn.softplus(jnp.where(known["hinge"], -votes.hinge, votes.hinge))
    losses["hinge"] = jnp.sum(moving * type_loss) / count
    # On handles the centre and the axes are best known, and there they are asked for most.
    emphasis = moving * jnp.where(known["classes"] == 2, _HANDLE_WEIGHT, 1.0)
    for name, values in votes.values.items():
        off = jnp.sqrt(jnp.sum((values - targets[name]) ** 2, axis=-1) + 1e-10)
        counted = emphasis if name in ("centre", "x", "y") else moving
        if name == "line":
            counted = counted * known["hinge"]
        elif name == "turn":
            counted = mask.astype(off.dtype)
        scale = votes.log_scale[name]
        loss = off * jnp.exp(-scale) + scale
        losses[name] = 0.5 * jnp.sum(counted * loss) / jnp.maximum(jnp.sum(counted), 1)
    losses = {name: jnp.where(known["sound"], loss, 0.0) for name, loss in losses.items()}
    losses["frame"] = jax.nn.softplus(jnp.where(known["right"], -votes.frame, votes.frame))
    return losses
