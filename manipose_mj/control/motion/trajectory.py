"""Timing: way points in, one joint target per control step out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from manipose_mj.mjcf.panda.kinematics import VELOCITY_LIMITS

SERVO_LAG = 0.05  # with which the arm follows `timed` targets, fitted to 2 mrad [s]


@dataclass(frozen=True)
class Timing:
    """Attributes: speed: share of the velocity limits; linear_speed: of the TCP along a straight
    line [m/s]; smoothing: standard deviation of the filter that rounds starts, stops and
    corners [s]."""

    speed: float = 0.45
    linear_speed: float = 0.12
    smoothing: float = 0.08


def timed(
    path: Float[np.ndarray, "n 7"],
    timestep: float,
    timing: Timing,
    *,
    lengths: Float[np.ndarray, "n-1"] | None = None,
) -> Float[np.ndarray, "t 7"]:
    """Joint targets [rad] that follow a path, beginning and ending at rest.

    Constant speed along every segment, then a Gaussian filter in time: it bounds the acceleration
    and cuts corners by less than the filter's width times the speed.

    Args:
      path: Way points [rad].
      timestep: Between targets [s].
      timing: Speeds and smoothing.
      lengths: Of the TCP's way along each segment [m], to bound its speed as well.
    """
    durations = (np.abs(np.diff(path, axis=0)) / (timing.speed * VELOCITY_LIMITS)).max(axis=1)
    if lengths is not None:
        durations = np.maximum(durations, lengths / timing.linear_speed)
    knots = np.concatenate([[0.0], np.cumsum(durations)])
    rest = 4 * timing.smoothing
    times = np.arange(-rest, knots[-1] + rest + timestep, timestep)
    targets = np.stack([np.interp(times, knots, column) for column in path.T], axis=1)
    smooth = gaussian_filter1d(targets, timing.smoothing / timestep, axis=0, mode="nearest")
    return np.concatenate([smooth, path[-1:]])


def tracked(targets: Float[np.ndarray, "t 7"], timestep: float) -> Float[np.ndarray, "t 7"]:
    """Where the arm is while it is sent `targets`: the servos follow as a first-order lag."""
    keep = float(np.exp(-timestep / SERVO_LAG))
    return lfilter([1 - keep], [1, -keep], targets, axis=0, zi=keep * targets[:1])[0]
