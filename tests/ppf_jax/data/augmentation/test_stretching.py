"""A stretched cloud is one that the camera would have seen of the stretched object."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.poses import invert, transform
from manipose_mj.ppf_jax.data.augmentation.outliers import outlier_augmented
from manipose_mj.ppf_jax.data.augmentation.stretching import stretched
from manipose_mj.ppf_jax.points.clouds import batch_clouds
from tests.ppf_jax.half_visible import half_visible_clouds

MOST = 0.15


def _stretched(category, indices, views):
    clouds = half_visible_clouds(category, indices, views, points=100)
    batch = batch_clouds(clouds, rng=np.random.default_rng(0), points=120)
    batch = jax.tree.map(jnp.asarray, batch)
    keys = jax.random.split(jax.random.key(0), len(batch))
    after = jax.jit(jax.vmap(lambda s, k: stretched(s, MOST, key=k)))(batch, keys)
    return jax.tree.map(np.asarray, (batch, after))


@pytest.mark.sample(2)
@pytest.mark.parametrize("category", ["mug", "bowl", "hammer", "box"])
def test_the_label_goes_with_the_points_and_normals_stay_normal(category):
    before, after = _stretched(category, [0, 1], 6)
    factors = after.extents / before.extents
    # A box's axes are told by its lengths alone: it keeps more of them.
    most = MOST / 2 if category == "box" else MOST
    farthest = np.abs(np.log(factors)).max()
    assert 0.8 * most < farthest < most + 1e-5
    assert np.array_equal(after.pose[:, :3, :3], before.pose[:, :3, :3])
    for i, count in enumerate(before.mask.sum(axis=1)):
        own, other = (
            transform(invert(b.pose[i].astype(float)), b.points[i, :count]) for b in (before, after)
        )
        assert np.allclose(other, factors[i] * own, atol=1e-5)
        assert np.allclose(np.linalg.norm(after.normals[i, :count], axis=1), 1, atol=1e-4)
        assert np.all(np.sum(after.normals[i] * after.points[i], axis=1)[:count] < 0)
        # A tangent of the surface, stretched along with it, stays one.
        into = before.pose[i, :3, :3]
        tangent = np.cross(before.normals[i, :count], [0.3, 0.5, 0.8])
        along = (tangent @ into * factors[i]) @ into.T
        assert np.abs(np.sum(along * after.normals[i, :count], axis=1)).max() < 1e-4
        assert not after.points[i, count:].any() and not after.normals[i, count:].any()


def test_what_is_equivalent_or_ordered_stays_so():
    _, bowls = _stretched("bowl", [0, 1, 2], 6)
    assert np.allclose(bowls.extents[:, 1], bowls.extents[:, 2], rtol=5e-3)
    before, boxes = _stretched("box", list(range(6)), 6)
    square = np.any(before.symmetry.rotations != np.eye(3), axis=(2, 3)).sum(axis=1) > 3
    assert square.any() and not square.all()
    assert np.allclose(boxes.extents[square, 1], boxes.extents[square, 2], rtol=1e-3)
    for batch in (before, boxes):
        order = np.diff(batch.extents, axis=1)
        assert np.all(order < 1e-3 * batch.extents[:, 1:])


@pytest.mark.full
def test_a_quarter_of_the_clouds_get_outliers_and_the_label_stays():
    clouds = half_visible_clouds("mug", [0, 1], 100, points=100)
    batch = batch_clouds(clouds, rng=np.random.default_rng(0), points=120)
    keys = jax.random.split(jax.random.key(0), len(batch))
    after = jax.jit(jax.vmap(lambda s, k: outlier_augmented(s, 0.4, key=k)))(batch, keys)
    after = jax.tree.map(np.asarray, after)
    moved = np.any(after.points != batch.points, axis=-1)
    assert np.array_equal(np.any(after.normals != batch.normals, axis=-1), moved)
    assert 0.1 < moved.any(axis=1).mean() < 0.4 and not moved[~batch.mask].any()
    shares = moved.sum(axis=1)[moved.any(axis=1)] / 100
    assert 0.1 < shares.mean() < 0.3 and shares.max() < 0.6
    reach = np.linalg.norm(after.points - batch.pose[:, None, :3, 3], axis=-1)
    assert np.all(reach[moved] < np.repeat(batch.extents.max(axis=1), moved.sum(axis=1)))
    assert np.all(np.sum(after.normals * after.points, axis=-1)[moved] <= 0)
    assert np.allclose(np.linalg.norm(after.normals[moved], axis=-1), 1, atol=1e-5)
    assert np.array_equal(after.pose, batch.pose) and np.array_equal(after.mask, batch.mask)
