"""A JAX that compiles quickly rather than well, and furniture that several files here use."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from manipose_mj.ppf_jax.data.articulated.clouds import FurnitureBatch, FurnitureScene
    from manipose_mj.ppf_jax.data.articulated.subject import ArticulatedSubject

# Read when JAX is imported. Most tests compile longer than they run.
os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")


@pytest.fixture(scope="module")
def cabinet() -> ArticulatedSubject:
    """A cabinet of the catalogue."""
    from manipose_mj.ppf_jax.data.articulated.subject import catalogue_furniture

    return catalogue_furniture("cabinet", 0)


@pytest.fixture(scope="module")
def scene(cabinet: ArticulatedSubject) -> FurnitureScene:
    """Small views of the cabinet, all of whose parts stand open."""
    from manipose_mj.ppf_jax.data.articulated.cache import random_scene
    from manipose_mj.ppf_jax.data.articulated.views import FurnitureSetting

    setting = FurnitureSetting(image_heights=(120,), all_shut=0.0, shut=0.0)
    return random_scene(cabinet, setting, 0, np.random.default_rng(3))


@pytest.fixture(scope="module")
def sample(scene: FurnitureScene) -> FurnitureBatch:
    """One row of a batch of the scene's clouds."""
    import jax
    import jax.numpy as jnp

    from manipose_mj.ppf_jax.data.articulated.clouds import batch_furniture, fused_cloud

    rng = np.random.default_rng(0)
    batch = batch_furniture([fused_cloud(scene, [0, 1])], rng=rng, points=1024, focus=1.0)
    return jax.tree.map(lambda leaf: jnp.asarray(leaf[0]), batch)
