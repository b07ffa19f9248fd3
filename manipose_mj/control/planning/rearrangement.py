"""Plans in clutter: one object at a time, what is free first; what is in the way is set aside.

Each plan is the next move only. After it the scene is observed again: in a pile everything moves a
little when one object is taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from math import radians

import numpy as np
from jaxtyping import Float

from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan import CandidatePlan, Plan
from manipose_mj.control.planning.table_places import (
    DROP_HEIGHT,
    is_free,
    resting_height,
    resting_rotation,
)
from manipose_mj.control.planning.transport import place, transport_plans
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, pose_error
from manipose_mj.tasks.goals import Goal, OnTableGoal, PoseGoal

# A goal that is met with so much to spare is left alone [m, rad].
_CLOSE = 0.012  # between objects of one crowd [m]
_CROWDED = 0.04  # between the circles about objects, which are wider than most of them [m]
_MET = (0.018, radians(13))
_TOUCHING = 0.002  # [m]
_ABOVE = 0.3  # of the direction to what touches an object along the vertical: it lies on the object
# How far the hand may push objects aside, first and when nothing else is left [m].
_CONTACT_ALLOWANCES = (0.001, 0.006, 0.012)
# Where objects are set aside: a grid that the arm reaches, and how far from all else [m].
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


def in_clutter(goals: tuple[Goal, ...], estimate: SceneEstimate) -> bool:
    """Whether the goals are about objects among others."""
    only_poses = all(isinstance(goal, PoseGoal | OnTableGoal) for goal in goals)
    return only_poses and len(estimate.objects) > 1 and not estimate.parts


def candidate_moves(
    goals: tuple[Goal, ...], estimate: SceneEstimate, planner: MotionPlanner
) -> Iterator[CandidatePlan]:
    """Next moves, the most promising first; a single one without steps when every pose is reached.

    Args:
      goals: All of them.
      estimate: What is where.
      planner: Of motions in the scene of `estimate`.

    Raises:
      InputError: There are no more moves.
    """
    pose_goals = [goal for goal in goals if isinstance(goal, PoseGoal)]
    unmet = [goal for goal in pose_goals if not _met(goal, estimate.objects[goal.object])]
    if not unmet:
        yield CandidatePlan(tuple)
        return
    moves = _moves(pose_goals, unmet, estimate, planner)
    for allowance in _CONTACT_ALLOWANCES:
        pushing = planner.allowing(allowance)
        for move in moves:
            yield CandidatePlan(partial(_move_plan, move, estimate, pushing), allowance)
    raise InputError(f"none of {len(moves)} things can be moved towards {unmet[0].object}'s goal")


def _move_plan(move: PoseGoal | Plan, estimate: SceneEstimate, planner: MotionPlanner) -> Plan:
    """The steps of a move."""
    return next(transport_plans(move, estimate, planner)) if isinstance(move, PoseGoal) else move


def _moves(
    pose_goals: list[PoseGoal],
    unmet: list[PoseGoal],
    estimate: SceneEstimate,
    planner: MotionPlanner,
) -> list[PoseGoal | Plan]:
    """Goals to reach and objects to set aside, the most promising first."""
    objects = estimate.objects
    covers = {name: _lying_on(estimate, obj, planner) for name, obj in objects.items()}
    done = {goal.object for goal in pose_goals} - {goal.object for goal in unmet}
    blocked = {
        goal.object: _blocking(goal, objects[goal.object], estimate, planner) for goal in unmet
    }
    free = [g for g in unmet if not covers[g.object] and not blocked[g.object]]
    in_the_way: list[str] = []
    for goal in unmet:
        in_the_way += [*_uncovered_above(goal.object, covers), *blocked[goal.object]]
    close = [obj.name for obj in _crowd(unmet, estimate, planner) if not covers[obj.name]]
    # When nothing else is left: what is near, and what is high up though something leans on it.
    near = [obj.name for obj in _nearby(unmet, estimate) if not covers[obj.name]]
    high = sorted(covers, key=lambda name: -float(objects[name].label_pose[2, 3]))
    targets = {goal.object for goal in unmet}
    last = [name for name in high if covers[name]]
    others = [name for name in (*close, *near, *last) if name not in targets]
    names = [n for n in dict.fromkeys((*in_the_way, *others)) if n not in done]
    # A target that can go to its goal need not be set aside.
    names = [n for n in names if n not in {goal.object for goal in free}]
    on_table = [objects[n] for n in names if objects[n].label_pose[2, 3] > 0]
    places = [(obj, _aside(obj, pose_goals, estimate, planner)) for obj in on_table]
    aside = [place(obj.name, poses) for obj, poses in places if poses]
    # In the end a target that something leans on may come out all the same.
    covered = [goal for goal in unmet if covers[goal.object] and not blocked[goal.object]]
    return [*free, *aside, *covered]


def _crowd(
    unmet: list[PoseGoal], estimate: SceneEstimate, planner: MotionPlanner
) -> list[ObjectEstimate]:
    """What is close to a target, or close to what is, and so on."""
    crowd = [estimate.objects[goal.object] for goal in unmet]
    for obj in crowd:
        geoms = {geom for geom, _ in planner.scene.touching(obj.geoms, _CLOSE)}
        for other in estimate.objects.values():
            known = any(other is one for one in crowd)
            if not known and any(other.geoms[geom] for geom in geoms):
                crowd.append(other)
    return crowd


def _nearby(unmet: list[PoseGoal], estimate: SceneEstimate) -> list[ObjectEstimate]:
    """What may be in the hand's way to a target, the nearest first."""
    gaps = {}
    for goal in unmet:
        obj = estimate.objects[goal.object]
        for name, other in estimate.objects.items():
            gap = _distance(obj, other) - _radius(obj) - _radius(other)
            gaps[name] = min(gap, gaps.get(name, np.inf))
    return [estimate.objects[n] for n in sorted(gaps, key=lambda n: gaps[n]) if gaps[n] < _CROWDED]


def is_supported(obj: ObjectEstimate, scene: PlanningScene) -> bool:
    """Whether something besides the robot is under it."""
    return any(
        upwards < -_ABOVE and not scene.robot[geom]
        for geom, upwards in scene.touching(obj.geoms, _TOUCHING)
    )


def _met(goal: PoseGoal, obj: ObjectEstimate) -> bool:
    translation, rotation = pose_error(obj.label_pose, goal.pose, obj.label.symmetry)
    return bool(translation < _MET[0] and rotation < _MET[1])


def _lying_on(estimate: SceneEstimate, obj: ObjectEstimate, planner: MotionPlanner) -> list[str]:
    """Names of the objects that lie on this one."""
    found = []
    for geom, upwards in planner.scene.touching(obj.geoms, _TOUCHING):
        if upwards > _ABOVE:
            found += [other.name for other in estimate.objects.values() if other.geoms[geom]]
    return list(dict.fromkeys(found))


def _uncovered_above(name: str, covers: dict[str, list[str]]) -> list[str]:
    """What lies on an object, directly or not, and has nothing on it itself."""
    above, waiting = [], list(covers[name])
    while waiting:
        other = waiting.pop(0)
        if other != name and other not in above:
            above.append(other)
            waiting += covers[other]
    return [other for other in above if not covers[other]]


def _blocking(
    goal: PoseGoal, obj: ObjectEstimate, estimate: SceneEstimate, planner: MotionPlanner
) -> list[str]:
    """What is where the goal wants the object."""
    if is_free(planner, obj, goal.pose):
        return []
    others = [other for other in estimate.objects.values() if other.name != goal.object]
    gaps = [
        (float(np.linalg.norm(other.label_pose[:2, 3] - goal.pose[:2, 3])), other.name)
        for other in others
        if np.linalg.norm(other.label_pose[:2, 3] - goal.pose[:2, 3])
        < _radius(other) + _radius(obj)
    ]
    return [name for _, name in sorted(gaps)]


def _aside(
    obj: ObjectEstimate, pose_goals: list[PoseGoal], estimate: SceneEstimate, planner: MotionPlanner
) -> tuple[Float[np.ndarray, "4 4"], ...]:
    """`T_world_label` where the object is out of everybody's way, turned as little as it can be."""
    taken = [
        (other.label_pose[:2, 3], _radius(other))
        for other in estimate.objects.values()
        if other.name != obj.name
    ]
    taken += [(goal.pose[:2, 3], _radius(estimate.objects[goal.object])) for goal in pose_goals]
    own = obj.label_pose[:2, 3]
    order = sorted(_PLACES, key=lambda place: float(np.linalg.norm(np.array(place) - own)))
    rotations = _rest_rotations(obj)
    for room in _ROOMS:
        found = []
        for xy in order:
            gaps = [np.linalg.norm(np.array(xy) - at) - radius for at, radius in taken]
            if min(gaps) < _radius(obj) + room:
                continue
            for rotation in rotations:
                height = resting_height(obj, rotation) + DROP_HEIGHT
                pose = compose(rotation, np.array([*xy, height]))
                if is_free(planner, obj, pose):
                    found.append(pose)
            if len(found) >= _MAX_PLACES * len(rotations):
                break
        if found:
            return tuple(found)
    return ()


def _rest_rotations(obj: ObjectEstimate) -> list[Float[np.ndarray, "3 3"]]:
    """`R_world_label` of the stable poses nearest to how the object lies now."""
    own = obj.label_pose[:3, :3]
    up = own[2] @ obj.label.rotation.T
    graspable = [
        rest
        for k, rest in enumerate(obj.rests)
        if len(obj.grasps) and obj.grasps.clear[:, k].sum() >= _MIN_CLEAR
    ]
    nearest = sorted(graspable, key=lambda rest: -float(rest.rotation[2] @ up))[:_MAX_RESTS]
    if not nearest:
        return [own]
    rotations = []
    for rest in nearest:
        turned = own @ resting_rotation(obj, rest, 0.0).T
        yaw = float(np.arctan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1]))
        rotations.append(resting_rotation(obj, rest, yaw))
    return rotations


def _distance(one: ObjectEstimate, other: ObjectEstimate) -> float:
    return float(np.linalg.norm(one.label_pose[:3, 3] - other.label_pose[:3, 3]))


def _radius(obj: ObjectEstimate) -> float:
    """Of a circle about the label's origin that the object stays in, however it lies [m]."""
    return float(np.linalg.norm(np.sort(obj.label.extents)[1:])) / 2
