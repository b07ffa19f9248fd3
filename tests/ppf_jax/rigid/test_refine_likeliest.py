"""Of the frames that the best may be mistaken for, the likeliest are refined, as all would be."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.ppf_jax.points.clouds import batch_clouds
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry
from manipose_mj.ppf_jax.rigid.evidence import Evidence
from manipose_mj.ppf_jax.rigid.features import normalised
from manipose_mj.ppf_jax.rigid.model import (
    ModelConfig,
    PoseModel,
    ambiguous_frames,
    cast_votes,
    read,
    refine_ambiguous,
    refine_likeliest,
)
from manipose_mj.ppf_jax.rigid.refinement import (
    RefinementConfig,
    expected_rotation_error,
    free_space,
)
from tests.ppf_jax.half_visible import half_visible_clouds

KEPT = 4
CUP, SAUSAGE, MUG = CommonSymmetry(True), CommonSymmetry(True, True), CommonSymmetry()


@pytest.mark.full
@pytest.mark.parametrize(
    ("symmetry", "ambiguous", "kept"), [(MUG, 9, KEPT), (CUP, 1, 1), (SAUSAGE, 0, 0)]
)
def test_they_are_those_of_least_expected_error_and_refined_like_all(symmetry, ambiguous, kept):
    refinement = RefinementConfig(
        widths=(32, 64), hidden=64, ambiguous_kept=KEPT, ambiguous_points=64
    )
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
        frames = ambiguous_frames(jnp.eye(3), jnp.zeros(3), seen, symmetry)
        expected_error = expected_rotation_error(read(model, seen.fewer(64), frames).logits)
        every = refine_ambiguous(model, seen, frames)
        return frames, expected_error, every, refine_likeliest(model, seen, frames)

    frames, expected_error, every, (as_they_were, refined) = found(model, cloud)
    assert len(frames.origin) == ambiguous
    assert len(as_they_were.origin) == len(refined.origin) == kept
    chosen = np.argsort(np.asarray(expected_error))[:kept]
    np.testing.assert_allclose(as_they_were.rotation, frames.rotation[chosen], atol=1e-6)
    np.testing.assert_allclose(refined.rotation, every.rotation[chosen], atol=1e-5)
    np.testing.assert_allclose(refined.origin, every.origin[chosen], atol=1e-5)
