"""Letting go of what the hand holds: how far to open, and a way back from it."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from jaxtyping import Float

from manipose_mj.control.execution.executor import Actions, Executor
from manipose_mj.control.grasping.candidates import OPENING_MARGIN
from manipose_mj.control.grasping.retreat import HANDLE_RETREATS, RETREATS, retreat
from manipose_mj.control.motion.batch_ik import forward
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.collision_query import CONTACT, CollisionQuery
from manipose_mj.control.scene.scene_estimate import SceneEstimate
from manipose_mj.failures import StageFailure
from manipose_mj.mjcf.panda.robot import MAX_OPENING
from manipose_mj.tasks.scene.overhang import from_below

# How far to open beyond what was held, best first; how far neighbours may be pushed on the way back [m].
_LETTING_GO = (OPENING_MARGIN, 0.006, 0.003)
_UNSURE_LETTING_GO = (0.04, 0.024)  # the same of an object whose shape is estimated
# The same of what lies over the table's edge: it sinks between the fingers.
_FROM_BELOW_LETTING_GO = (MAX_OPENING, 0.055, 0.04, 0.025)
_GIVING_WAY = (0.006, 0.012)
_LEAST_RETREAT = 0.03  # from what was taken where there is little room [m]
_LOST = 0.01  # what is further from the hand has fallen from it [m]
_OWN_PART = -0.02  # how deep a hand may be in the estimate of the part that it lets go [m]
_SETTLE = 0.25  # after letting go [s]
_HANGS = 0.03  # how far a hand that still hangs on a handle is from where it should have backed off to [m]


def let_go(
    executor: Executor, planner: MotionPlanner, name: str, *, close: bool = False
) -> Actions:
    """Open the hand and back off from what it holds.

    A handle whose shape is estimated may be wider in front of the fingers than between them: where the hand does not come
    away, it opens all the way and backs off once more.

    Args:
      executor: Of actions.
      planner: Says what to assume.
      name: Of the object or part.
      close: Whether it was taken where there is little room to come to it.

    Raises:
      StageFailure: There is no way back.
    """
    estimate = executor.observe()
    planner = planner.within(estimate.scene)
    yield from executor.open_to(opening_to_let_go(planner, estimate, name))
    yield from executor.wait(_SETTLE)
    executor.hold(None)
    felt = executor.feels_joints and name in estimate.parts
    for last in (False, True):
        estimate = executor.observe()
        planner = planner.within(estimate.scene)
        line = _way_back(planner, estimate, name, _OWN_PART if felt else None, close=close)
        yield from executor.follow(line)
        if last or not felt or _off(executor.joints(), line[-1]) < _HANGS:
            return
        yield from executor.relax()
        yield from executor.open_to(MAX_OPENING)


def _way_back(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    name: str,
    near: float | None,
    *,
    close: bool,
) -> Float[np.ndarray, "t 7"]:
    """As `retreat_from`, but a short way where there is no room for more, as between an oven and its open flap."""
    try:
        return retreat_from(planner, estimate, name, near, close=close)
    except StageFailure:
        if close:
            raise
        return retreat_from(planner, estimate, name, near, close=True)


def _off(joints: Float[np.ndarray, "7"], target: Float[np.ndarray, "7"]) -> float:
    """How far the hand is from where joint targets [rad] have it [m]."""
    places = forward(np.stack([joints, target]))[0][:, :3, 3]
    return float(np.linalg.norm(places[0] - places[1]))


def opening_to_let_go(planner: MotionPlanner, estimate: SceneEstimate, name: str) -> float:
    """How far to open [m]: as far as neighbours allow."""
    released = estimate.parts.get(name) or estimate.objects[name]
    margins = _LETTING_GO
    query = CollisionQuery(replace(CONTACT, arm=0.0), target=released.geoms)
    if name in estimate.objects and estimate.objects[name].uncertainty > 0:
        # What is not known well may hang on the fingers; they may be in its estimate, but not come deeper in.
        margins = (*_UNSURE_LETTING_GO, *_LETTING_GO)
        query = planner.excusing(estimate.joints, query)
    if name in estimate.objects and from_below(planner.tcp_pose(estimate.joints)):
        margins = (*_FROM_BELOW_LETTING_GO, *margins)
    for margin in margins:
        opening = min(estimate.opening + margin, MAX_OPENING)
        if not planner.collides(estimate.joints, replace(query, opening=opening)):
            return opening
    return min(estimate.opening + _LETTING_GO[0], MAX_OPENING)


def retreat_from(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    name: str,
    near: float | None = None,
    *,
    close: bool = False,
) -> Float[np.ndarray, "t 7"]:
    """Joint targets back off from what was let go; where nothing else is left, past neighbours that give way.

    Args:
      planner: Plans in the scene of the estimate.
      estimate: What is where.
      name: Of what was let go.
      near: How near the hand may be to it on the way, negative for touching [m]; None: as is usual.
      close: Whether a short way back will do.

    Raises:
      StageFailure: There is no way.
    """
    released = estimate.parts.get(name) or estimate.objects[name]
    distances = HANDLE_RETREATS if name in estimate.parts else RETREATS
    if close:
        distances = (*distances, _LEAST_RETREAT)
    touched = frozenset({planner.body_name(released.body)})
    for excused, allowance in product((False, True), (0.0, *_GIVING_WAY)):
        pushing = planner.allowing(max(allowance, planner.contact_allowance))
        line = retreat(pushing, estimate, released.geoms, touched, distances, near, excused)
        if line is not None:
            return line
    near_by = CollisionQuery(replace(CONTACT, arm=-np.inf, target=_LOST), target=released.geoms)
    if name in estimate.objects and not planner.collides(estimate.joints, near_by):
        return estimate.joints[None]  # there is nothing to back off from
    raise StageFailure("release", f"no way to back off from {name}")
