"""Backing off from what the hand has let go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.collision_query import CONTACT, TRANSIT, CollisionQuery
from manipose_mj.control.scene.scene_estimate import SceneEstimate

# How far to back off after letting go, best first [m]; the last must do.
RETREATS = (0.12, 0.18, 0.09, 0.06)
HANDLE_RETREATS = (0.10, 0.07, 0.045)


def retreat(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    released: Bool[np.ndarray, "ngeom"],
    touched: frozenset[str],
    distances: Sequence[float] = RETREATS,
    near: float | None = None,
    excused: bool = False,
) -> Float[np.ndarray, "t 7"] | None:
    """Joint targets straight back, or else up, to where the next motion has room if there is such a place.

    Args:
      planner: Plans in the scene of `estimate`.
      estimate: What is where.
      released: Mask of the geoms that the gripper may touch on the way.
      touched: Names of bodies that it touches.
      distances: To try, the best first [m].
      near: How near the hand may be to what was released, negative for touching [m]; None: as is usual.
      excused: Where the scene has the robot in something from the start, as estimates may, it need but get no deeper in.
    """
    clearance = replace(CONTACT, arm=0.0)
    if near is not None:
        clearance = replace(clearance, target=near, arm=near / 2)
    query = CollisionQuery(clearance, target=released)
    if excused:
        query = planner.excusing(estimate.joints, query)
        touched = touched | planner.ignored(query)
    back = (planner.backed_off(estimate.joints, distance) for distance in distances)
    up = (planner.raised(estimate.joints, distance) for distance in distances)
    for ways in (back, up):
        found = None
        for way in ways:
            line = planner.line(estimate.joints, way, query, touched=touched)
            if line is not None and not planner.collides(line[-1], CollisionQuery(TRANSIT)):
                return line
            found = line if found is None else found
        if found is not None:
            return found
    return None
