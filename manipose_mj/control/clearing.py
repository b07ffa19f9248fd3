"""Plans in clutter: one thing at a time, what is free first; what is in the way is set aside.

Each plan is the next move only. After it the scene is looked at again: in a pile everything moves a
little when one thing is taken.
"""

from __future__ import annotations

from math import radians

import numpy as np
from jaxtyping import Float

from manipose_mj.control.belief import Belief, ObjectBelief
from manipose_mj.control.carrying import carry, place
from manipose_mj.control.motion_planner import MotionPlanner
from manipose_mj.control.plan import Plan
from manipose_mj.control.table_places import (
    DROP_HEIGHT,
    is_free,
    resting_height,
    resting_rotation,
)
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, pose_error
from manipose_mj.tasks.goals import Goal, OnTableGoal, PoseGoal

# A goal that is met with so much to spare is left alone [m, rad].
_CLOSE = 0.012  # between things of one crowd [m]
_CROWDED = 0.04  # between the circles about things, which are wider than most of them [m]
_MET = (0.018, radians(13))
_TOUCHING = 0.002  # [m]
_ABOVE = 0.3  # of the direction to what touches a thing along the vertical: it lies on the thing
# How far the hand may push things aside, first and when nothing else is left [m].
_NUDGES = (0.001, 0.006, 0.012)
# Where things are set aside: a grid that the arm reaches, and how far from all else [m].
_PLACES = tuple(
    (float(x), float(y))
    for x in np.linspace(0.30, 0.66, 6)
    for y in np.linspace(-0.55, 0.55, 13)
    if 0.33 < np.hypot(x, y) < 0.70
)
_ROOMS = (0.09, 0.05, 0.02, -0.02)
_MAX_PLACES = 6
_MAX_RESTS = 2
_MIN_CLEAR = 3  # grasps of a stable pose that make it worth setting something down in


def in_clutter(goals: tuple[Goal, ...], belief: Belief) -> bool:
    """Whether the goals are about things among others."""
    only_poses = all(isinstance(goal, PoseGoal | OnTableGoal) for goal in goals)
    return only_poses and len(belief.objects) > 1 and not belief.parts


def next_move(
    goals: tuple[Goal, ...], belief: Belief, planner: MotionPlanner, skip: int = 0
) -> Plan:
    """The most promising next move; empty when every pose is reached.

    Args:
      goals: All of them.
      belief: What is where.
      planner: Of motions in the scene of `belief`.
      skip: So many moves that come first; they turned out not to work.

    Raises:
      InputError: There is no move that has not been tried.
    """
    wanted = [goal for goal in goals if isinstance(goal, PoseGoal)]
    unmet = [goal for goal in wanted if not _met(goal, belief.objects[goal.object])]
    if not unmet:
        return ()
    moves = _moves(wanted, unmet, belief, planner)
    count = len(moves)
    if skip >= count * len(_NUDGES):
        raise InputError(f"none of {count} things can be moved towards {unmet[0].object}'s goal")
    planner.scene.nudge = _NUDGES[skip // count]
    move = moves[skip % count]
    return carry(move, belief, planner) if isinstance(move, PoseGoal) else move


def _moves(
    wanted: list[PoseGoal], unmet: list[PoseGoal], belief: Belief, planner: MotionPlanner
) -> list[PoseGoal | Plan]:
    """Goals to reach and things to set aside, the most promising first."""
    things = belief.objects
    covers = {name: _lying_on(belief, thing, planner) for name, thing in things.items()}
    done = {goal.object for goal in wanted} - {goal.object for goal in unmet}
    blocked = {goal.object: _blocking(goal, things[goal.object], belief, planner) for goal in unmet}
    free = [g for g in unmet if not covers[g.object] and not blocked[g.object]]
    in_the_way: list[str] = []
    for goal in unmet:
        in_the_way += [*_uncovered_above(goal.object, covers), *blocked[goal.object]]
    close = [thing.name for thing in _crowd(unmet, belief, planner) if not covers[thing.name]]
    # When nothing else is left: what is near, and what is high up though something leans on it.
    near = [thing.name for thing in _nearby(unmet, belief) if not covers[thing.name]]
    high = sorted(covers, key=lambda name: -float(things[name].label_pose[2, 3]))
    targets = {goal.object for goal in unmet}
    last = [name for name in high if covers[name]]
    others = [name for name in (*close, *near, *last) if name not in targets]
    names = [n for n in dict.fromkeys((*in_the_way, *others)) if n not in done]
    # A target that can go to its goal need not be set aside.
    names = [n for n in names if n not in {goal.object for goal in free}]
    on_table = [things[n] for n in names if things[n].label_pose[2, 3] > 0]
    places = [(thing, _aside(thing, wanted, belief, planner)) for thing in on_table]
    aside = [place(thing.name, poses) for thing, poses in places if poses]
    # In the end a target that something leans on may come out all the same.
    covered = [goal for goal in unmet if covers[goal.object] and not blocked[goal.object]]
    return [*free, *aside, *covered]


def _crowd(unmet: list[PoseGoal], belief: Belief, planner: MotionPlanner) -> list[ObjectBelief]:
    """What is close to a target, or close to what is, and so on."""
    crowd = [belief.objects[goal.object] for goal in unmet]
    for thing in crowd:
        geoms = {geom for geom, _ in planner.scene.touching(thing.geoms, _CLOSE)}
        for other in belief.objects.values():
            known = any(other is one for one in crowd)
            if not known and any(other.geoms[geom] for geom in geoms):
                crowd.append(other)
    return crowd


def _nearby(unmet: list[PoseGoal], belief: Belief) -> list[ObjectBelief]:
    """What may be in the hand's way to a target, the nearest first."""
    gaps = {}
    for goal in unmet:
        thing = belief.objects[goal.object]
        for name, other in belief.objects.items():
            gap = _distance(thing, other) - _radius(thing) - _radius(other)
            gaps[name] = min(gap, gaps.get(name, np.inf))
    return [belief.objects[n] for n in sorted(gaps, key=lambda n: gaps[n]) if gaps[n] < _CROWDED]


def is_supported(thing: ObjectBelief, planner: MotionPlanner) -> bool:
    """Whether something besides the robot is under it."""
    return any(
        upwards < -_ABOVE and not planner.scene.robot[geom]
        for geom, upwards in planner.scene.touching(thing.geoms, _TOUCHING)
    )


def _met(goal: PoseGoal, thing: ObjectBelief) -> bool:
    translation, rotation = pose_error(thing.label_pose, goal.pose, thing.label.symmetry)
    return bool(translation < _MET[0] and rotation < _MET[1])


def _lying_on(belief: Belief, thing: ObjectBelief, planner: MotionPlanner) -> list[str]:
    """Names of the objects that lie on this one."""
    found = []
    for geom, upwards in planner.scene.touching(thing.geoms, _TOUCHING):
        if upwards > _ABOVE:
            found += [other.name for other in belief.objects.values() if other.geoms[geom]]
    return list(dict.fromkeys(found))


def _uncovered_above(name: str, covers: dict[str, list[str]]) -> list[str]:
    """What lies on a thing, directly or not, and has nothing on it itself."""
    above, waiting = [], list(covers[name])
    while waiting:
        other = waiting.pop(0)
        if other != name and other not in above:
            above.append(other)
            waiting += covers[other]
    return [other for other in above if not covers[other]]


def _blocking(
    goal: PoseGoal, thing: ObjectBelief, belief: Belief, planner: MotionPlanner
) -> list[str]:
    """What is where the goal wants the thing."""
    if is_free(planner, thing, goal.pose):
        return []
    others = [other for other in belief.objects.values() if other.name != goal.object]
    gaps = [
        (float(np.linalg.norm(other.label_pose[:2, 3] - goal.pose[:2, 3])), other.name)
        for other in others
        if np.linalg.norm(other.label_pose[:2, 3] - goal.pose[:2, 3])
        < _radius(other) + _radius(thing)
    ]
    return [name for _, name in sorted(gaps)]


def _aside(
    thing: ObjectBelief, wanted: list[PoseGoal], belief: Belief, planner: MotionPlanner
) -> tuple[Float[np.ndarray, "4 4"], ...]:
    """`T_world_label` where the thing is out of everybody's way, turned as little as it can be."""
    taken = [
        (other.label_pose[:2, 3], _radius(other))
        for other in belief.objects.values()
        if other.name != thing.name
    ]
    taken += [(goal.pose[:2, 3], _radius(belief.objects[goal.object])) for goal in wanted]
    own = thing.label_pose[:2, 3]
    order = sorted(_PLACES, key=lambda place: float(np.linalg.norm(np.array(place) - own)))
    rotations = _rest_rotations(thing)
    for room in _ROOMS:
        found = []
        for xy in order:
            gaps = [np.linalg.norm(np.array(xy) - at) - radius for at, radius in taken]
            if min(gaps) < _radius(thing) + room:
                continue
            for rotation in rotations:
                height = resting_height(thing, rotation) + DROP_HEIGHT
                pose = compose(rotation, np.array([*xy, height]))
                if is_free(planner, thing, pose):
                    found.append(pose)
            if len(found) >= _MAX_PLACES * len(rotations):
                break
        if found:
            return tuple(found)
    return ()


def _rest_rotations(thing: ObjectBelief) -> list[Float[np.ndarray, "3 3"]]:
    """`R_world_label` of the stable poses nearest to how the thing lies now."""
    own = thing.label_pose[:3, :3]
    up = own[2] @ thing.label.rotation.T
    graspable = [
        rest
        for k, rest in enumerate(thing.rests)
        if len(thing.grasps) and thing.grasps.clear[:, k].sum() >= _MIN_CLEAR
    ]
    nearest = sorted(graspable, key=lambda rest: -float(rest.rotation[2] @ up))[:_MAX_RESTS]
    if not nearest:
        return [own]
    rotations = []
    for rest in nearest:
        turned = own @ resting_rotation(thing, rest, 0.0).T
        yaw = float(np.arctan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1]))
        rotations.append(resting_rotation(thing, rest, yaw))
    return rotations


def _distance(one: ObjectBelief, other: ObjectBelief) -> float:
    return float(np.linalg.norm(one.label_pose[:3, 3] - other.label_pose[:3, 3]))


def _radius(thing: ObjectBelief) -> float:
    """Of a circle about the label's origin that the thing stays in, however it lies [m]."""
    return float(np.linalg.norm(np.sort(thing.label.extents)[1:])) / 2
