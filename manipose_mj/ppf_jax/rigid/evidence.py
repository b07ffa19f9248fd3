"""What hypotheses about one view are held against."""

from __future__ import annotations

import equinox as eqx
from jaxtyping import Array, Float

from manipose_mj.ppf_jax.rigid.features import Cloud
from manipose_mj.ppf_jax.rigid.network import PairVotes


class Evidence(eqx.Module):
    """What hypotheses about a cloud are held against.

    Attributes:
      cloud: The cloud.
      votes: Some of its votes.
      log_extents: What the voting network takes the lengths for, in the cloud's units.
      free: `(m, 3)`, points that the camera looked through, in the cloud's units.
    """

    cloud: Cloud
    votes: PairVotes
    log_extents: Float[Array, "3"]
    free: Float[Array, "m 3"]

    def fewer(self, points: int) -> Evidence:
        """The same with the first, which are random, of the cloud's points."""
        cloud = self.cloud
        return Evidence(
            Cloud(
                points=cloud.points[:points],
                normals=cloud.normals[:points],
                views=cloud.views[:points],
                mask=cloud.mask[:points],
                centre=cloud.centre,
                scale=cloud.scale,
            ),
            self.votes,
            self.log_extents,
            self.free,
        )
