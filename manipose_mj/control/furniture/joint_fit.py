"""A joint from the way that a point of its part went: the arc of the gripper on a handle is the best sensor of a hinge.

The estimate from clouds is the prior; the points that the gripper went through correct it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from manipose_mj.assets.geometry import Joint
from manipose_mj.poses import rotation_about

_NOISE = 0.0015  # of the gripper on a bar, at most [m]
_LEAST_NOISE = 0.0002  # the same where it holds it well [m]
_OFFSET = 0.008  # standard deviation of the bar's place in the hand, about which the hand turns [m]
_AXIS = np.radians(15.0)  # standard deviations of what clouds say: of an axis' direction,
_PLACE = 0.06  # and of a hinge's place [m]
_LEVEL = np.radians(
    0.2
)  # of drawers, which slide level; a hand that pulls is a few millimetres off its way
_SURE_AXIS, _SURE_PLACE = np.radians(3.0), 0.008  # the same of what a long arc has said before
_SHORT = 0.006  # ways that are shorter tell nothing [m]
_CURVED = 3.0  # how many times better a hinge must fit for a drawer to be a door
_LEAST_RADIUS = 0.05  # of hinges, from the handle [m]
_QUARTER = np.pi / 2  # of a turn [rad]


@dataclass(frozen=True)
class FittedJoint:
    """Attributes: joint; misfit: root mean square distance from its path [m]; offset: `(3,)`, of the point of the part
    that went so, in the hand [m]."""

    joint: Joint
    misfit: float
    offset: Float[np.ndarray, "3"]


def fitted_joint(
    joint: Joint, path: Float[np.ndarray, "n 4 4"], *, sure: bool = False
) -> FittedJoint:
    """The joint, corrected.

    A hand need not turn with the bar that it holds: which of its points goes with the part is found too.

    Args:
      joint: As clouds have it; its axis points to where it opens.
      path: `T_joint_tcp` as the part opens; the first is where it began.
      sure: Whether a long arc has corrected it before: a hand that slips off does not change it much.
    """
    points = path[:, :3, 3]
    gone = float(np.linalg.norm(points - points[0], axis=1).max())
    if gone < _SHORT:
        return FittedJoint(joint, 0.0, np.zeros(3))
    if joint.kind == "hinge":
        return _fitted_hinge(joint, path, sure)
    straight = _fitted_slide(joint, points)
    if straight.misfit < 2 * _NOISE or gone < 0.05:
        return straight
    turned = _hinge_of(straight.joint, path)
    if turned is not None and turned.misfit * _CURVED < straight.misfit:
        return turned
    return straight


def _fitted_slide(joint: Joint, path: Float[np.ndarray, "n 3"]) -> FittedJoint:
    offset = path - path[0]
    _, _, directions = np.linalg.svd(offset)
    along = directions[0] * np.sign(directions[0] @ offset[-1])
    if along @ joint.axis < 0:  # it was pushed shut
        along = -along
    length = float(np.linalg.norm(offset, axis=1).max())
    certain, prior = (length / _NOISE) ** 2, 1 / _AXIS**2
    # Led up or down, the bar would slip out of the hand.
    level = np.array([0.0, 0.0, 1 / _LEVEL**2])
    axis = (certain * along + prior * joint.axis) / (certain + prior + level)
    axis /= np.linalg.norm(axis)
    off = offset - (offset @ along)[:, None] * along
    misfit = float(np.sqrt((off**2).sum(axis=1).mean()))
    return FittedJoint(replace(joint, axis=axis), misfit, np.zeros(3))


def _fitted_hinge(
    joint: Joint, path: Float[np.ndarray, "n 4 4"], sure: bool = False
) -> FittedJoint:
    """Axis and place that the path circles, near those that are known."""
    turns, places = (_SURE_AXIS, _SURE_PLACE) if sure else (_AXIS, _PLACE)
    first, second = _across(joint.axis)
    basis = np.stack([first, second], axis=1)
    # The point of the axis abreast of the handle.
    began = path[0, :3, 3]
    foot = joint.origin + ((began - joint.origin) @ joint.axis) * joint.axis

    def changed(by: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turn = basis @ by[:2]
        angle = float(np.linalg.norm(turn))
        axis = joint.axis
        if angle > 1e-9:
            axis = rotation_about(turn / angle, angle) @ axis
        return axis, foot + basis @ by[2:4]

    def off(by: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _off_circle(points_of(path, by[4:]), *changed(by))

    def residuals(by: np.ndarray, noise: float) -> np.ndarray:
        out, high = off(by)
        prior = [by[:2] / turns, by[2:4] / places, by[4:] / _OFFSET]
        return np.concatenate([out / noise, high / noise, *prior])

    # A path is trusted as far as it is an arc.
    found, noise = np.zeros(7), _LEAST_NOISE
    for _ in range(2):
        found = least_squares(residuals, found, args=(noise,), loss="soft_l1", max_nfev=60).x
        misfit = float(np.sqrt(np.square(off(found)).sum(axis=0).mean()))
        noise = float(np.clip(misfit, _LEAST_NOISE, _NOISE))
    axis, place = changed(found)
    if np.linalg.norm(np.cross(began - place, axis)) < _LEAST_RADIUS:
        return FittedJoint(joint, float("inf"), np.zeros(3))
    return FittedJoint(replace(joint, axis=axis, origin=place), misfit, found[4:])


def points_of(
    path: Float[np.ndarray, "n 4 4"], offset: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "n 3"]:
    """Where a point of the hand at `offset` [m] from the TCP is."""
    return path[:, :3, 3] + path[:, :3, :3] @ offset


def _hinge_of(joint: Joint, path: Float[np.ndarray, "n 4 4"]) -> FittedJoint | None:
    """A hinge that the path of what was taken for a drawer circles."""
    points = path[:, :3, 3]
    offset = points - points[0]
    _, _, directions = np.linalg.svd(offset - offset.mean(axis=0))
    normal = directions[2]
    u, v = directions[0], directions[1]
    flat = np.column_stack([offset @ u, offset @ v])
    # x^2 + y^2 = 2 a x + 2 b y + c
    rows = np.column_stack([2 * flat, np.ones(len(flat))])
    solution, *_ = np.linalg.lstsq(rows, (flat**2).sum(axis=1), rcond=None)
    center = points[0] + solution[0] * u + solution[1] * v
    out = points[0] - center
    axis = normal * np.sign(np.cross(normal, out) @ joint.axis)
    if not axis.any() or not _LEAST_RADIUS < np.linalg.norm(out) < 1.2:
        return None
    hinge = replace(joint, kind="hinge", axis=axis, origin=center, range=(0.0, 1.75))
    return _fitted_hinge(hinge, path)


def _off_circle(
    path: Float[np.ndarray, "n 3"], axis: Float[np.ndarray, "3"], place: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """How far points are outside the circle of the first, and above its plane [m]."""
    arm = path - place
    high = (path - path[0]) @ axis
    radii = np.linalg.norm(arm - (arm @ axis)[:, None] * axis, axis=1)
    return radii - radii[0], high


def _across(axis: Float[np.ndarray, "3"]) -> tuple[np.ndarray, np.ndarray]:
    first = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def opening_of(
    joint: Joint,
    start: Float[np.ndarray, "3"],
    now: Float[np.ndarray, "3"],
    about: float = _QUARTER,
) -> float:
    """By how much a joint has moved that took a point from `start` to `now` [m or rad], in its frame.

    Args:
      joint: Of the part.
      start: `(3,)`.
      now: `(3,)`.
      about: By how much a hinge has moved, to within half a turn [rad]; by default doors are taken to be open by up to
        three quarters of a turn.
    """
    if joint.kind == "slide":
        return float((now - start) @ joint.axis)
    arms = [p - joint.origin for p in (start, now)]
    arms = [arm - (arm @ joint.axis) * joint.axis for arm in arms]
    sine = float(np.cross(arms[0], arms[1]) @ joint.axis)
    turned = np.arctan2(sine, arms[0] @ arms[1])
    return float(turned + 2 * np.pi * np.round((about - turned) / (2 * np.pi)))


def gone_along(joint: Joint, path: Float[np.ndarray, "n 3"]) -> float:
    """By how much a joint has moved that took a point along a path, however far round [m or rad], in its frame."""
    gone = 0.0
    for now in path:
        gone = opening_of(joint, path[0], now, gone)
    return gone
