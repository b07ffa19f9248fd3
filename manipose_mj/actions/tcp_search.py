"""Inverse kinematics for one control step, whatever computes the kinematics: NumPy, or JAX under `jit`.

Levenberg-Marquardt with a damping that follows the error, which converges for poses out of reach too
(T. Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", T-RO 27(5),
2011); joints at a limit drop out of the step that would cross it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.poses import Array, namespace
from manipose_mj.small_matrices import product, product_with_vector, solve_positive, squared_length

_LOW, _HIGH = POSITION_LIMITS.T
_ROUNDS = 3  # in which joints may drop out of a step


@dataclass(frozen=True)
class TcpSolverConfig:
    """Attributes: iterations: at most; damping: added to the squared error [m^2]; lever: metres that
    a radian of tilt counts; tolerance: error that ends the search [m]; least_gain: the share of the
    squared error that may be left by an iteration that is worth another; max_step: of a joint in one
    iteration [rad]."""

    iterations: int = 25
    damping: float = 1e-5
    lever: float = 0.3
    tolerance: float = 1e-7
    least_gain: float = 0.999
    max_step: float = 0.3


class _Search(NamedTuple):
    """Attributes: joints, the best so far, and their error; squared, its square; caution, a factor of the
    damping; done, whether more is not worth it; iterations, so far."""

    joints: Float[Array, "7"]
    error: Float[Array, "6"]
    squared: Float[Array, ""]
    caution: Float[Array, ""]
    done: Bool[Array, ""]
    iterations: Int[Array, ""]


def search(
    error_at: Callable[[Float[Array, "7"]], Float[Array, "6"]],
    jacobian_at: Callable[[Float[Array, "7"]], Float[Array, "6 7"]],
    start: Float[Array, "7"],
    config: TcpSolverConfig,
) -> tuple[Float[Array, "7"], Float[Array, ""]]:
    """The configuration next to `start` whose TCP is nearest to a pose, within the joint limits.

    Args:
      error_at: From the TCP to the pose: position, then turn times the lever [m].
      jacobian_at: Of the TCP's position, and of its turn times the lever.
      start: Joint angles to start from [rad].
      config: When to stop, and how bold to be.

    Returns:
      Joint angles [rad], and the length of the error that is left [m].
    """
    xp = namespace(start)
    joints = xp.clip(start, _LOW, _HIGH)
    error = error_at(joints)
    one = xp.ones_like(joints[0])
    first = _Search(joints, error, squared_length(error), one, one < 0, xp.asarray(0))

    def going(now: _Search) -> Bool[Array, ""]:
        unfinished = (now.squared >= config.tolerance**2) & (now.iterations < config.iterations)
        return unfinished & ~now.done

    def improved(now: _Search) -> _Search:
        damping = now.caution * (0.5 * now.squared + config.damping)
        joints = damped_step(
            now.joints, jacobian_at(now.joints), now.error, damping, config.max_step
        )
        error = error_at(joints)
        squared = squared_length(error)
        better = squared < now.squared
        return _Search(
            xp.where(better, joints, now.joints),
            xp.where(better, error, now.error),
            xp.where(better, squared, now.squared),
            xp.where(better, xp.maximum(1.0, now.caution / 10.0), now.caution * 10.0),
            # Where little is gained any more the pose is out of reach.
            better & (squared > config.least_gain * now.squared),
            now.iterations + 1,
        )

    last = first
    if xp is np:
        while going(last):
            last = improved(last)
    else:
        import jax

        last = jax.lax.while_loop(going, improved, first)
    return last.joints, xp.sqrt(last.squared)


def damped_step(
    joints: Float[Array, "7"],
    jacobian: Float[Array, "6 7"],
    error: Float[Array, "6"],
    damping: float | Float[Array, ""],
    max_step: float,
) -> Float[Array, "7"]:
    """The joints after one damped step; those that would cross a limit stay, the others make up for it."""
    xp = namespace(joints)

    def stepped(moving: Bool[Array, "7"]) -> tuple[Float[Array, "7"], Bool[Array, "7"]]:
        """Where the joints that may move come to, and which of these may do so without crossing a limit."""
        used = jacobian * moving
        gram = product(used, used.T) + damping * xp.eye(6, dtype=joints.dtype)
        step = product_with_vector(used.T, solve_positive(gram, error))
        step = step * xp.minimum(1.0, max_step / xp.maximum(xp.max(xp.abs(step)), 1e-12))
        free = joints + step
        allowed = xp.clip(free, _LOW, _HIGH)
        return allowed, moving & (allowed == free)

    now = joints, xp.ones(7, dtype=bool)
    if xp is not np:
        import jax

        return jax.lax.fori_loop(0, _ROUNDS, lambda _, now: stepped(now[1]), now)[0]
    for _ in range(_ROUNDS):
        before, now = now[1], stepped(now[1])
        if (now[1] == before).all():
            break  # another round would find the same
    return now[0]
