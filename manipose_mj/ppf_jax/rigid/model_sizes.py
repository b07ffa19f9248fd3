"""How large the networks are that learn one category, and those that learn all of a type."""

from __future__ import annotations

from collections.abc import Sequence

from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry, common_symmetry
from manipose_mj.ppf_jax.rigid.model import ModelConfig
from manipose_mj.ppf_jax.rigid.network import NetworkConfig
from manipose_mj.ppf_jax.rigid.refinement import RefinementConfig
from manipose_mj.ppf_jax.rigid.voting import VotingConfig

TYPE_POINTS = 384


def model_config(clouds: Sequence[LabelledCloud]) -> ModelConfig:
    """The model for a training set: of one category, or of several.

    Args:
      clouds: All that is trained on.
    """
    symmetry = common_symmetry(cloud.symmetry for cloud in clouds)
    if len({cloud.category for cloud in clouds}) == 1:
        return category_config(symmetry)
    return type_config(symmetry)


def category_config(symmetry: CommonSymmetry) -> ModelConfig:
    """With fewer votes and hypotheses than the defaults, which are slower and no better (`docs/guides/pose_estimation.md`)."""
    return ModelConfig(
        symmetry=symmetry,
        voting=VotingConfig(axes_kept=2 if symmetry.axial else 3),
        pairs=ModelConfig.pairs // 2,
    )


def type_config(symmetry: CommonSymmetry) -> ModelConfig:
    """Wider networks that see more points, and more hypotheses.

    What tells two ends of an object apart differs from category to category and is often small, such
    as a straw; where it is hidden, votes for an end say nothing, those for the line still do.
    """
    return ModelConfig(
        symmetry=symmetry,
        network=NetworkConfig(local_width=48, width=96, pair_width=96, lines=True),
        voting=VotingConfig(axes_kept=6),
        refinement=RefinementConfig(
            widths=(96, 192), hidden=192, coarse_points=TYPE_POINTS, ambiguous_kept=8
        ),
        # Votes for one axis need be half as many as those for a frame.
        pairs=ModelConfig.pairs // (2 if symmetry.axial else 1),
        points=TYPE_POINTS,
    )
