"""Pushing a drawer or door with closed fingers: all the way, or in stages, each as far as a push can lead it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from manipose_mj.control.grasping.handle_grasps import (
    Push,
    opening_pushes,
    shifted,
    shutting_pushes,
)
from manipose_mj.control.grasping.part_motion import PartWay, find_way, promise
from manipose_mj.control.grasping.part_pick import is_a_stage, share_of
from manipose_mj.control.motion.batch_ik import forward
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.articulation import joint_motion
from manipose_mj.control.scene.collision_query import CONTACT, CollisionQuery
from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.failures import StageFailure

# From which a surface is approached: off it, and back along the hand [m].
_PUSH_STANDOFFS = ((0.05, 0.0), (0.03, 0.0), (0.02, 0.12), (0.02, 0.07))
_ALIKE = 0.03  # between pushes that meet a part at nearly the same place [m]
_MAX_PUSHES = 24  # for which a way is looked for
_MAX_IN_STAGES = 48  # the same, where none has to lead all the way
_MAX_TRIES = 12  # ways for which an approach is looked for
_ALL_THE_WAY = 0.999  # of what is asked
_BLOCKED = 0.03  # how far from its end a hand is that something stopped [m]


@dataclass(frozen=True)
class PartPush:
    """How to push a part: joint targets to where the approach starts, along it and of the push
    itself `(t, 7)`; way: what the push does."""

    free_path: Float[np.ndarray, "t 7"]
    approach: Float[np.ndarray, "s 7"]
    way: PartWay


def push_part(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    part: PartEstimate,
    opening: float,
    in_vain: Sequence[Push] = (),
    *,
    in_stages: bool = False,
) -> PartPush:
    """A push with closed fingers that moves the part all the way; none near those that were made in vain.

    Args:
      planner: Plans in the scene of the estimate.
      estimate: What is where.
      part: What to push.
      opening: Where to [m or rad].
      in_vain: Pushes that hardly moved it.
      in_stages: Where none can be made that leads all the way, the one that leads farthest will do.

    Raises:
      StageFailure: There is none.
    """
    complete = tried = 0
    stages: list[PartWay] = []
    holds = list(_pushes(planner, part, opening))
    holds = [hold for hold in holds if not any(_alike(hold, other) for other in in_vain)]
    holds.sort(key=lambda hold: -promise(part, hold, opening))
    for hold in holds[: _MAX_IN_STAGES if in_stages else _MAX_PUSHES]:
        tried += 1
        way = find_way(planner, part, hold, opening, near=estimate.joints)
        if way is None:
            continue
        if share_of(way, part, opening) < _ALL_THE_WAY:
            if in_stages and is_a_stage(way, part):
                stages.append(way)
            continue
        complete += 1
        push = _approached(planner, estimate, part, hold, way)
        if push is not None:
            return push
        if complete == _MAX_TRIES:
            break
    stages.sort(key=lambda way: -share_of(way, part, opening))
    for way in stages[:_MAX_TRIES]:
        assert isinstance(way.hold, Push)
        push = _approached(planner, estimate, part, way.hold, way)
        if push is not None:
            return push
    raise StageFailure(
        "plan", f"no push moves {part.name}: {tried} tried, {complete} of them lead all the way"
    )


def _approached(
    planner: MotionPlanner, estimate: SceneEstimate, part: PartEstimate, hold: Push, way: PartWay
) -> PartPush | None:
    """A push along a way, if the hand can come to where it starts."""
    query = CollisionQuery(CONTACT, opening=hold.opening, target=part.geoms)
    for line in _lines_off(planner, part, hold, float(way.tilts[0]), way.joints[0], query):
        free_path = planner.free_path(
            estimate.joints, line[-1], CollisionQuery(opening=hold.opening)
        )
        if free_path is not None:
            approach = np.concatenate([line[::-1], way.joints[:1]])
            return PartPush(free_path, approach, way)
    return None


def reached_by(way: PartWay, joints: Float[np.ndarray, "7"]) -> tuple[float, bool]:
    """How far a push has led its part [m or rad], and whether something stopped the hand, by where the arm is [rad]."""
    places = forward(np.concatenate([way.joints, joints[None]]))[0][:, :3, 3]
    off = np.linalg.norm(places[:-1] - places[-1], axis=1)
    return float(way.openings[int(off.argmin())]), bool(off[-1] > _BLOCKED)


def off_surface(
    planner: MotionPlanner, part: PartEstimate, way: PartWay, joints: Float[np.ndarray, "7"]
) -> Float[np.ndarray, "t 7"] | None:
    """Joint targets away from what was pushed, from where the push ended; out of what estimates have the hand in."""
    assert isinstance(way.hold, Push)
    usual = CollisionQuery(CONTACT, target=part.geoms)
    for query in (usual, planner.excusing(joints, usual)):
        for line in _lines_off(planner, part, way.hold, float(way.tilts[-1]), joints, query):
            return line
    return None


def _pushes(planner: MotionPlanner, part: PartEstimate, opening: float) -> Iterator[Push]:
    if opening < part.opening:
        return shutting_pushes(planner, part)
    return opening_pushes(planner, part)


def _alike(one: Push, other: Push) -> bool:
    """Whether two pushes meet a part at nearly the same place."""
    near = float(np.linalg.norm(one.point - other.point)) < _ALIKE
    return near and one.flat == other.flat and float(one.normal @ other.normal) > 0.9


def _lines_off(
    planner: MotionPlanner,
    part: PartEstimate,
    hold: Push,
    tilt: float,
    joints: Float[np.ndarray, "7"],
    query: CollisionQuery,
) -> Iterator[Float[np.ndarray, "t 7"]]:
    """Straight lines off the surface, the part where the scene has it."""
    touched = frozenset({planner.body_name(part.body)}) | planner.ignored(query)
    pose = part.base_pose @ joint_motion(part, part.opening)
    for away, back in _PUSH_STANDOFFS:
        goal = pose @ shifted(hold, away).tcp_poses(np.array([tilt]))[0]
        goal[:3, 3] -= back * goal[:3, 2]
        line = planner.line(joints, goal, query, touched=touched)
        if line is not None:
            yield line
