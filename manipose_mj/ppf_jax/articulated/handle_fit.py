"""Fits handles, and the doors that they are on, to all points of a cloud, after the network's votes.

A network that sees some 2,048 points knows about where a handle is and what it is on, but neither where a long
bar ends nor where a wide door does. The cloud shows both: what stands out from the panel goes on along a bar up
to its ends, and the panel up to the door's edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from manipose_mj.poses import compose
from manipose_mj.ppf_jax.articulated.binned_counts import binned_counts
from manipose_mj.ppf_jax.articulated.part_voting import unit
from manipose_mj.ppf_jax.points.rotations import from_vector


@dataclass(frozen=True)
class HandleFitConfig:
    """How points are told to be of a handle, or of its door.

    Attributes:
      reaches: How far from the voted centre points of the handle are looked for, along it, in turn [m].
      across: How far from its axis they may be [m].
      height: From which share of the handle's height above the panel on they are the handle's.
      gap: Without a point, that does not end a handle [m].
      turned: Length from which on a handle's points say which way it runs [m].
      least: Points without which a handle stays where it was voted.
      strip: Half the width, along the hinge, of what is looked at of a door [m].
      thick: How far from the door's plane points of it may be [m].
      door_gap: As `gap`, of a door: a handle's shadow on it is wider [m].
      begin: Where the search for the door's end starts, from the handle's centre [m].
      inset: Of a hinge, from the door's edge [m].
      snap: Most that an upright hinge is moved by, of doors whose plane has gaps or is cut off [m].
      snap_level: Most that a level one is: below a flap a plinth often goes on in its plane.
      notch: Share of the points around it with which a strip of the door's plane is taken for a gap
        between two doors. Where there is none up to the plane's end, the hinge is not before it.
      deepest: How far behind the front beside it a hinge may be [m]: half of what the deepest of the catalogue have,
        for no view of a shut door tells where in it the hinge is.
    """

    reaches: tuple[float, ...] = (0.07, 0.15, 0.45)
    across: float = 0.015
    height: float = 0.5
    gap: float = 0.02
    turned: float = 0.06
    least: int = 6
    strip: float = 0.15
    thick: float = 0.012
    door_gap: float = 0.03
    begin: float = 0.06
    inset: float = 0.005
    snap: float = 0.10
    snap_level: float = 0.02
    notch: float = 0.6
    deepest: float = 0.018


class Joint(eqx.Module):
    """A handle and the joint of its part, in any frame.

    Attributes:
      handle: `(4, 4)`, X along the handle, Y out of the panel.
      hinge: Probability of turning; else the part slides.
      origin: `(3,)` [m], on the joint's axis; the handle's centre of a part that slides.
      axis: `(3,)`, unit.
    """

    handle: Float[Array, "4 4"]
    hinge: Float[Array, ""]
    origin: Float[Array, "3"]
    axis: Float[Array, "3"]


_BIN = 0.0025  # [m]
_PANEL_BIN = 0.002  # [m]
_HIGHEST, _LOWEST = -0.004, -0.08  # of panels, from the handle's centre [m]
# Half of the part of a panel that is looked at, along and across the handle [m].
_AROUND = (0.10, 0.08)
_USUAL = -0.03  # height of a panel that does not show [m]
_TELLING = 20  # points of a plane, at least
# Where the front beside a hinge is looked at: from it towards the handle, and before and behind it [m].
_BESIDE = (0.005, 0.06)
_AT_HINGE = 0.10
_NOISE = 0.004  # of points across a handle [m]
_FARTHEST = 1.5  # edge of a door [m]
_DOOR_LEAST = 2  # points of a door in a bin: fewer are strays
_ROUNDS = 4  # of reweighting
_AROUND_NOTCH = 8  # bins to either side that a gap is told by
_NOTCH_LEAST = 6.0  # points in a bin, on average, for a gap to be told
_UPRIGHT = 0.7  # cosine between upright hinges and the vertical, at least
_FRONT = 0.03  # how far before its voted centre a handle may still be [m]


def fitted(
    points: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    joint: Joint,
    up: Float[Array, "3"],
    config: HandleFitConfig,
) -> Joint:
    """The handle between its ends and along its points, and the hinge at the edge of its door.

    What the points do not show stays as it was.

    Args:
      points: The whole cloud [m], in the joint's frame.
      mask: True for points, false for padding.
      joint: As voted.
      up: Unit, either way.
      config: How points are chosen.
    """
    handle, panel = _fitted_handle(points, mask, joint.handle, config)
    # The part turns with its handle: both were voted in one frame.
    turn = handle[:3, :3] @ joint.handle[:3, :3].T
    axis = turn @ joint.axis
    turns = joint.hinge > 0.5
    origin = handle[:3, 3] + turn @ (joint.origin - joint.handle[:3, 3])
    origin = jnp.where(turns, origin, handle[:3, 3])
    most = jnp.where(jnp.abs(axis @ up) > _UPRIGHT, config.snap, config.snap_level)
    moved = _fitted_hinge(points, mask, handle, panel, origin, axis, most, config)
    moved = _near_front(points, mask, handle, moved, axis, config)
    return Joint(handle, joint.hinge, jnp.where(turns, moved, origin), axis)


def _fitted_handle(
    points: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    handle: Float[Array, "4 4"],
    config: HandleFitConfig,
) -> tuple[Float[Array, "4 4"], Float[Array, ""]]:
    """The handle, and the height of its panel above its centre [m]."""
    centre, farthest = handle[:3, 3], max(config.reaches)

    def refine(
        known: tuple[Array, Array, Array, Array], reach: Array
    ) -> tuple[tuple[Array, Array, Array, Array], None]:
        rotation = known[0]
        own = (points - centre) @ rotation
        panel = _panel_height(own, mask)
        on = mask & (jnp.abs(own[:, 2]) < config.across) & (jnp.abs(own[:, 0]) < reach)
        on &= (own[:, 1] > config.height * panel) & (own[:, 1] < _FRONT)
        high, low = (
            _end(binned_counts(along, on, (0.0, farthest), _BIN), _BIN, config.gap)
            for along in (own[:, 0], -own[:, 0])
        )
        on &= (own[:, 0] <= high) & (own[:, 0] >= -low)
        sure = (jnp.sum(on) >= config.least) & (high + low > config.turned)
        slope = jnp.where(sure, _slope(own[:, 0], own[:, 2], on), 0.0)
        rotation = rotation @ from_vector(jnp.array([0.0, -1.0, 0.0]) * jnp.arctan(slope))
        high, low = (jnp.where(jnp.sum(on) >= config.least, end, 0.0) for end in (high, low))
        return (rotation, high, low, panel), None

    start = handle[:3, :3], jnp.zeros(()), jnp.zeros(()), jnp.asarray(_USUAL)
    (rotation, high, low, panel), _ = jax.lax.scan(refine, start, jnp.asarray(config.reaches))
    return compose(rotation, centre + 0.5 * (high - low) * rotation[:, 0]), panel


def _fitted_hinge(
    points: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    handle: Float[Array, "4 4"],
    panel: Float[Array, ""],
    origin: Float[Array, "3"],
    axis: Float[Array, "3"],
    most: Float[Array, ""],
    config: HandleFitConfig,
) -> Float[Array, "3"]:
    """A point of the hinge, moved across to the door's edge if that is no more than `most` [m] away."""
    centre, out = handle[:3, 3], handle[:3, 1]
    across = unit(jnp.cross(axis, out))
    voted = (origin - centre) @ across
    across, voted = across * jnp.where(voted < 0, -1.0, 1.0), jnp.abs(voted)
    offset = points - centre
    of_door = mask & (jnp.abs(offset @ out - panel) < config.thick)
    of_door &= jnp.abs(offset @ axis) < config.strip
    counts = binned_counts(offset @ across - config.begin, of_door, (0.0, _FARTHEST), 2 * _BIN)
    reach = _end(counts, 2 * _BIN, config.door_gap, least=_DOOR_LEAST)
    by = config.begin + reach - config.inset - voted
    plain = ~_has_notch(counts, reach, 2 * _BIN, config.notch)
    # Beyond its end the door may go on unseen; before it, it does not end without a gap.
    near = (jnp.abs(by) < most) | (plain & (by > 0))
    return origin + jnp.where(near & (reach > 0), by, 0.0) * across


def _near_front(
    points: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    handle: Float[Array, "4 4"],
    origin: Float[Array, "3"],
    axis: Float[Array, "3"],
    config: HandleFitConfig,
) -> Float[Array, "3"]:
    """A point of the hinge, brought forward to where it is `config.deepest` behind the front beside it."""
    centre, out = handle[:3, 3], handle[:3, 1]
    towards = unit(jnp.cross(axis, out))
    towards *= jnp.where((centre - origin) @ towards < 0, -1.0, 1.0)
    offset = points - origin
    beside = offset @ towards
    front = mask & (beside > _BESIDE[0]) & (beside < _BESIDE[1])
    front &= jnp.abs((points - centre) @ axis) < config.strip
    height = _densest(offset @ out, front, (-_AT_HINGE, _AT_HINGE), -_AT_HINGE)
    return origin + jnp.maximum(height - config.deepest, 0.0) * out


def _panel_height(own: Float[Array, "n 3"], mask: Bool[Array, "n"]) -> Float[Array, ""]:
    """Where most of the points behind a handle are, from its centre outwards [m]."""
    behind = mask & (jnp.abs(own[:, 0]) < _AROUND[0]) & (jnp.abs(own[:, 2]) < _AROUND[1])
    return _densest(own[:, 1], behind, (_LOWEST, _HIGHEST), _USUAL)


def _densest(
    heights: Float[Array, "n"], on: Bool[Array, "n"], span: tuple[float, float], usual: float
) -> Float[Array, ""]:
    """Where most of these points are [m]; `usual` where too few are within the span to tell."""
    on &= (heights > span[0]) & (heights < span[1])
    counts = binned_counts(heights, on, span, _PANEL_BIN)
    counts = jnp.convolve(counts, jnp.ones(3), mode="same")
    height = span[0] + (jnp.argmax(counts) + 0.5) * _PANEL_BIN
    return jnp.where(jnp.sum(on) < _TELLING, usual, height)


def _end(
    counts: Float[Array, "bins"], width: float, gap: float, *, least: int = 1
) -> Float[Array, ""]:
    """How far points go on from 0 without a gap [m]; 0 if there are none."""
    step = jnp.arange(len(counts))
    taken = counts >= least
    last = jax.lax.cummax(jnp.where(taken, step, 0))
    before = jnp.concatenate([jnp.zeros(1, last.dtype), last[:-1]])
    beyond = jnp.cumsum(taken & (step - before > round(gap / width))) > 0
    return width * jnp.max(jnp.where(taken & ~beyond, step + 1, 0)).astype(jnp.float32)


def _has_notch(
    counts: Float[Array, "bins"], reach: Float[Array, ""], width: float, share: float
) -> Bool[Array, ""]:
    """Whether a bin before the end has fewer points than this share of the mean around it.

    Also where there are too few points to tell.
    """
    step = jnp.arange(len(counts))
    inside = step < jnp.round(reach / width)
    others = jnp.ones(2 * _AROUND_NOTCH + 1).at[_AROUND_NOTCH].set(0.0)
    known = jnp.convolve(inside.astype(jnp.float32), others, mode="same")
    mean = jnp.convolve(jnp.where(inside, counts, 0.0), others, mode="same")
    mean = mean / jnp.maximum(known, 1.0)
    sampled = inside & (step >= 2) & (step < jnp.round(reach / width) - 3)
    few = (counts < share * mean) | (mean < _NOTCH_LEAST)
    return jnp.any(sampled & few)


def _slope(
    along: Float[Array, "n"], across: Float[Array, "n"], on: Bool[Array, "n"]
) -> Float[Array, ""]:
    """Of the line through points of a handle, strays counted little (Cauchy's weights)."""
    first = jnp.where(on, 1.0, 0.0)

    def refine(_: int, state: tuple[Array, Array]) -> tuple[Array, Array]:
        slope, weight = state
        total = jnp.sum(weight) + 1e-9
        x = along - weight @ along / total
        z = across - weight @ across / total
        slope = weight @ (x * z) / (weight @ x**2 + 1e-9)
        return slope, first / (1 + ((z - slope * x) / _NOISE) ** 2)

    return jax.lax.fori_loop(0, _ROUNDS, refine, (jnp.zeros(()), first))[0]
