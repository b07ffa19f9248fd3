"""Random targets of many arms: what measurements of speed let them do."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from manipose_mj import batch

HELD = 25  # control steps for which a random target is held
SPREAD = 0.6  # of random targets about the start [rad]


def random_targets(state: batch.State, steps: int) -> jax.Array:
    """Joint targets about where the arms are, and openings, each held for a while: (steps, worlds, 8) [rad, m]."""
    joints = state.measurement.joints
    held = -(-steps // HELD)
    keys = jax.random.split(jax.random.key(1), 2)
    arm = joints + SPREAD * jax.random.uniform(keys[0], (held, *joints.shape), minval=-1.0)
    opening = jax.random.uniform(keys[1], (held, len(joints), 1), maxval=0.08)
    return jnp.repeat(jnp.concatenate([arm, opening], axis=-1), HELD, axis=0)[:steps]
