"""Of the frames that the best may be mistaken for, the likeliest are refined, as all would be."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from half_visible import half_visible_clouds

from manipose_mj.ppf_jax.clouds import batch_clouds
from manipose_mj.ppf_jax.features import normalised
from manipose_mj.ppf_jax.model import (
    Evidence,
    ModelConfig,
    PoseModel,
    cast_votes,
    read,
    refine_likeliest,
    refine_related,
    related,
)
from manipose_mj.ppf_jax.refinement import RefinementConfig, expected_turn, free_space
from manipose_mj.ppf_jax.symmetry import CommonSymmetry

KEPT = 4
CUP, SAUSAGE, MUG = CommonSymmetry(True), CommonSymmetry(True, True), CommonSymmetry()


@pytest.mark.parametrize(
    ("symmetry", "kin", "kept"), [(MUG, 9, KEPT), (CUP, 1, 1), (SAUSAGE, 0, 0)]
)
def test_they_are_those_of_least_doubt_and_refined_like_all(symmetry, kin, kept):
    refinement = RefinementConfig(widths=(32, 64), hidden=64, related_kept=KEPT, related_points=64)
    config = ModelConfig(symmetry=symmetry, refinement=refinement)
    model = PoseModel(config, rng=np.random.default_rng(0))
    clouds = half_visible_clouds("mug", [0], 1, points=128)
    batch = batch_clouds(clouds, rng=np.random.default_rng(0), points=128)
    cloud = jax.jit(normalised)(
        *(jnp.asarray(x[0]) for x in (batch.points, batch.normals, batch.mask))
    )
    key = jax.random.key(0)

    @jax.jit
    def found(model, cloud):
        votes, log_extents = cast_votes(model, cloud, 256, key=key)
        seen = Evidence(cloud, votes, log_extents, free_space(cloud, refinement, key=key))
        frames = related(jnp.eye(3), jnp.zeros(3), seen, symmetry)
        doubt = expected_turn(read(model, seen.fewer(64), frames).logits)
        every = refine_related(model, seen, frames)
        return frames, doubt, every, refine_likeliest(model, seen, frames)

    frames, doubt, every, (as_they_were, refined) = found(model, cloud)
    assert len(frames.origin) == kin
    assert len(as_they_were.origin) == len(refined.origin) == kept
    chosen = np.argsort(np.asarray(doubt))[:kept]
    np.testing.assert_allclose(as_they_were.rotation, frames.rotation[chosen], atol=1e-6)
    np.testing.assert_allclose(refined.rotation, every.rotation[chosen], atol=1e-5)
    np.testing.assert_allclose(refined.origin, every.origin[chosen], atol=1e-5)
